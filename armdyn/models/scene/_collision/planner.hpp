// RRT-Connect in joint space: J. J. Kuffner, S. M. LaValle, "RRT-Connect: an efficient approach to single-query path
// planning", ICRA 2000.
//
// OMPL also has this planner, but seeds its random numbers once per process, so that a second call with the same seed
// returns a different path, and answers would depend on earlier calls.
#pragma once

#include "scene.hpp"

#include <functional>

namespace armdyn {

using Point = Eigen::VectorXd;
using Path = std::vector<Point>;
using Randoms = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

// Points are joint positions over `speed`, lengths in seconds.
struct JointSpace {
  Point start, goal, lower, upper, speed;
  const double* least;  // see `Scene::is_free`
  double step;          // distance of collision checks, in the largest component
  double reach;         // growth of a tree towards a random point
};

class Planner {
 public:
  // At most `budget` collision checks; `stop` is polled regularly.
  Planner(Scene& scene, JointSpace space, long budget, std::function<bool()> stop)
      : scene_(scene), space_(std::move(space)), q_(space_.speed.size()), budget_(budget), stop_(std::move(stop)) {}

  // Path within at most `checks` checks, with random points in the unit cube; empty: not found.
  Path connect(const Randoms& random, long checks);

  // Replace parts of a path by straight segments if these are free and shorter, with at most `checks` checks; each
  // row of `random` has the two ends of one, as parts of the path's length.
  void shorten(Path& path, const Randoms& random, long checks);

  long used() const { return used_; }

 private:
  class Tree;
  struct Grown {
    int index;  // last added point, -1: none
    bool hit;   // whether that point is the target
  };
  void begin(long checks);
  bool is_free(const Point& point);
  bool segment_is_free(const Point& a, const Point& b);
  Grown extend(Tree& tree, const Point& target, bool far);

  Scene& scene_;
  const JointSpace space_;
  Point q_;
  long budget_, left_ = 0, used_ = 0;
  std::function<bool()> stop_;
};

}  // namespace armdyn
