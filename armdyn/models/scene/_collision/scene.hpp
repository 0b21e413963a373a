// Distances among the solids of an arm, and to obstacles, by coal on convex geometry.
#pragma once

#include <coal/collision.h>
#include <coal/distance.h>
#include <coal/shape/geometric_shapes.h>

#include <Eigen/Geometry>

#include <memory>
#include <utility>
#include <vector>

namespace armdyn {

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;
using Points = Eigen::Matrix<double, 3, Eigen::Dynamic>;
using Shape = std::shared_ptr<coal::CollisionGeometry>;

struct Place {
  Matrix turn = Matrix::Identity();
  Vector at = Vector::Zero();
};

// Moving joint k + 1 in Pinocchio's order; joint 0 is the world.
struct Joint {
  int parent;     // index of the parent joint
  bool slides;    // else revolute
  Vector axis;    // unit vector in the joint's frame
  Place placement;  // in the parent joint
};

// Solid on a joint.
struct Solid {
  Shape shape;
  int joint;        // 0: the world
  Place placement;  // of the shape in the joint's frame
  // Hull: balls around points in the joint's frame that contain it; for a half space a point and its normal.
  Points points;
  double radius;
  bool half_space;
  Vector outward;
  // For lower bounds: balls that contain an arm's solid, in the joint's frame; for an obstacle an oriented box.
  std::vector<Vector> centers;
  double ball;
  Vector lower, upper;
  Vector middle = Vector::Zero();  // centre of a ball that contains these balls
  double around = 0;
};

struct Witness {
  double distance;
  Vector normal, first, second;  // unit, from the first solid to the second; nearest points
};

// Joints follow cubics between samples; bounds on their motion as in `MotionBounds`.
struct Motion {
  int samples;
  const double *t, *q, *v;
  const double* travel;        // samples x joints
  const double* acceleration;  // (samples - 1) x (joints + 1): largest of the solids' points on each joint
};

struct Proof {
  bool sure = true;
  std::vector<double> missed;
  int pair = 0;  // nearest pair
  double distance = 0, time = 0;
};

// Scene for one thread, because of its workspace of placements and solvers.
class Scene {
 public:
  Scene(std::vector<Joint> joints, std::vector<Solid> solids, std::vector<std::pair<int, int>> pairs,
        std::vector<int> touching);
  Scene(const Scene&) = delete;

  int nv() const { return static_cast<int>(joints_.size()); }
  int pairs() const { return static_cast<int>(pairs_.size()); }
  int touching() const { return static_cast<int>(touching_.size()); }

  // Place all solids at joint positions.
  void place(const double* q);

  // Whether no pair overlaps at joint positions; `least`: smallest allowed distance [m], negative: overlap.
  bool is_free(const double* q, const double* least);

  // Lower bounds on the distances of all pairs at the present placements; and the distance of one pair.
  void bounds(double* out) const;
  Witness distance(int pair);

  // Gradient of a pair's distance in the joint positions.
  void gradient(int pair, const Witness& at, double* out) const;

  // Prove that pairs keep `required` along a motion; `reach`: pairs x joints, see `relative_reach`.
  Proof prove(const Motion& motion, const double* required, const double* reach, int pieces, int most);

 private:
  friend class Search;

  Vector world(const Place& joint, const Vector& point) const { return joint.turn * point + joint.at; }
  coal::Transform3s placed(const Solid& solid) const;
  double bound(int pair) const;
  bool far(int pair) const;
  bool overlaps(int pair);
  double away(const Solid& box, const Vector& point) const;
  void move(const double* v);
  double gap(int pair, const Vector& normal, double time) const;

  std::vector<Joint> joints_;
  std::vector<Solid> solids_;
  std::vector<std::pair<int, int>> pairs_;
  std::vector<int> touching_;
  std::vector<char> may_touch_;
  std::vector<Place> frames_;                  // placements of the joints
  std::vector<Vector> axes_, speeds_, turns_;  // axes of the joints; velocities of their origins, angular velocities
  std::vector<std::vector<Vector>> centers_;   // centres of the solids' balls in the world
  std::vector<Vector> middles_;                // middles in the world
  std::vector<char> carries_;                  // whether joint column moves joint row
  int last_hit_ = 0;  // last overlapping pair, checked first
  std::vector<std::unique_ptr<coal::ComputeDistance>> distances_;
  std::vector<std::unique_ptr<coal::ComputeCollision>> collisions_;
};

}  // namespace armdyn
