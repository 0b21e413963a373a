// Distances between the solids of an arm, and between these and obstacles, by coal on convex geometry.
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
  int parent;     // index of the joint that carries it
  bool slides;    // else it turns
  Vector axis;    // unit, in its frame
  Place placement;  // in the parent joint
};

// A solid that a joint carries.
struct Solid {
  Shape shape;
  int joint;        // 0: the world
  Place placement;  // of the shape in the joint's frame
  // Its hull: balls around points in the joint's frame contain it. Of a half space a point of its plane and its normal.
  Points points;
  double radius;
  bool half_space;
  Vector outward;
  // For lower bounds: balls that contain an arm's solid, in the joint's frame; of an obstacle a box along its own axes.
  std::vector<Vector> centers;
  double ball;
  Vector lower, upper;
  Vector middle = Vector::Zero();  // of a ball that contains these balls
  double around = 0;
};

struct Witness {
  double distance;
  Vector normal, first, second;  // unit, from the first solid to the second; nearest points
};

// Joints follow cubics between samples; bounds on their motion as of `MotionBounds`.
struct Motion {
  int samples;
  const double *t, *q, *v;
  const double* travel;        // samples x joints
  const double* acceleration;  // (samples - 1) x (joints + 1): of points of the solids on each joint
};

struct Proof {
  bool sure = true;
  std::vector<double> missed;
  int pair = 0;  // the nearest
  double distance = 0, time = 0;
};

// One scene, for one thread: placements and solvers are its work space.
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

  // Whether no pair overlaps at joint positions; a touching one may be `least` [m] apart, negative: overlap so far.
  bool is_free(const double* q, const double* least);

  // Lower bounds on the distances of all pairs where the solids are; and the distance of one.
  void bounds(double* out) const;
  Witness distance(int pair);

  // Gradient of a pair's distance by the joint positions.
  void gradient(int pair, const Witness& at, double* out) const;

  // Prove that pairs keep `asked` along a motion; `reach`: pairs x joints, as of `relative_reach`.
  Proof prove(const Motion& motion, const double* asked, const double* reach, int pieces, int most);

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
  std::vector<Place> frames_;                  // of the joints
  std::vector<Vector> axes_, speeds_, turns_;  // axes of the joints; velocities of their origins, angular velocities
  std::vector<std::vector<Vector>> centers_;   // of the solids' balls in the world
  std::vector<Vector> middles_;                // likewise
  std::vector<char> carries_;                  // whether joint column moves joint row
  int last_hit_ = 0;  // the pair that overlapped last is looked at first
  std::vector<std::unique_ptr<coal::ComputeDistance>> distances_;
  std::vector<std::unique_ptr<coal::ComputeCollision>> collisions_;
};

}  // namespace armdyn
