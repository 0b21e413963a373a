// Proof of clearances between samples: bisection by bounds on speed and acceleration; see proof_of_clearance.py.
#include "scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace armdyn {

class Search {
 public:
  Search(Scene& scene, const Motion& motion, const double* required, const double* reach, int pieces, int most)
      : scene_(scene), motion_(motion), required_(required), reach_(reach), left_(most),
        at_(scene.nv()), rate_(scene.nv()) {
    const double first = motion.t[0], last = motion.t[motion.samples - 1];
    for (int k = 0; k <= pieces; ++k) ends_.push_back(k < pieces ? first + (last - first) * k / pieces : last);
    const std::size_t pairs = scene.pairs();
    bounds_.resize(ends_.size() * pairs);
    exact_.assign(bounds_.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t k = 0; k < ends_.size(); ++k) {
      place(ends_[k]);
      scene.bounds(&bounds_[k * pairs]);
    }
  }

  Proof run() {
    proof_.distance = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k + 1 < ends_.size(); ++k)
      for (int pair = 0; pair < scene_.pairs(); ++pair) piece(k, pair);
    nearest();
    proof_.missed.assign(missed_.begin(), missed_.end());
    proof_.sure = proof_.sure && missed_.empty();
    return proof_;
  }

 private:
  // Bisect the unproven rest of one of the equal pieces.
  void piece(std::size_t k, int pair) {
    struct Part {
      double a, b, at_a, at_b;
    };
    const std::size_t pairs = scene_.pairs();
    const double required = required_[pair], moved = moved_by(pair, ends_[k], ends_[k + 1]);
    if (bounds_[k * pairs + pair] + bounds_[(k + 1) * pairs + pair] - moved >= 2 * required) return;
    std::vector<Part> todo{{ends_[k], ends_[k + 1], at_end(k, pair), at_end(k + 1, pair)}};
    while (!todo.empty()) {
      const Part part = todo.back();
      todo.pop_back();
      if (std::min(part.at_a, part.at_b) < required) continue;  // known violation
      if (part.at_a + part.at_b - moved_by(pair, part.a, part.b) >= 2 * required) continue;
      if (separated(pair, part.a, part.b, part.a, 1) && separated(pair, part.a, part.b, part.b, -1)) continue;
      const double middle = (part.a + part.b) / 2;
      if (left_ <= 0 || !(part.a < middle && middle < part.b)) {
        proof_.sure = false;
        continue;
      }
      --left_;
      place(middle);
      const double here = look(pair, middle);
      todo.push_back({part.a, middle, part.at_a, here});
      todo.push_back({middle, part.b, here, part.at_b});
    }
  }

  // Whether a pair keeps its distance in the half of a piece next to an end.
  bool separated(int pair, double a, double b, double end, double sign) {
    const double half = (b - a) / 2;
    place(end);
    const Vector normal = scene_.distance(pair).normal;
    scene_.move(rate_.data());
    const auto [i, j] = scene_.pairs_[pair];
    const int joints[] = {scene_.solids_[i].joint, scene_.solids_[j].joint}, width = scene_.nv() + 1;
    double added = 0;
    for (const int joint : joints) {
      double most = 0;
      for (int s = step(a); s <= step(b); ++s) most = std::max(most, motion_.acceleration[s * width + joint]);
      added += most * half * half / 2;
    }
    const double gap = std::min(scene_.gap(pair, normal, 0.0), scene_.gap(pair, normal, sign * half));
    return gap - added >= required_[pair];
  }

  // Nearest pair at the ends of the pieces.
  void nearest() {
    const std::size_t pairs = scene_.pairs();
    for (std::size_t k = 0; k < ends_.size(); ++k)
      for (std::size_t pair = 0; pair < pairs; ++pair)
        if (bounds_[k * pairs + pair] < proof_.distance) at_end(k, static_cast<int>(pair));
  }

  double at_end(std::size_t k, int pair) {
    double& known = exact_[k * scene_.pairs() + pair];
    if (std::isnan(known)) {
      place(ends_[k]);
      known = look(pair, ends_[k]);
    }
    return known;
  }

  // Distance of a pair at the present placements.
  double look(int pair, double time) {
    const double distance = scene_.distance(pair).distance;
    if (distance < proof_.distance) proof_.distance = distance, proof_.pair = pair, proof_.time = time;
    if (distance < required_[pair]) missed_.insert(time);
    return distance;
  }

  void place(double time) {
    if (time == placed_) return;
    placed_ = time;
    const int k = step(time), n = scene_.nv();
    const double h = motion_.t[k + 1] - motion_.t[k], s = (time - motion_.t[k]) / h;
    for (int j = 0; j < n; ++j) {  // a cubic, as in `Trajectory`
      const double q = motion_.q[k * n + j], v = motion_.v[k * n + j], w = motion_.v[(k + 1) * n + j];
      const double rise = motion_.q[(k + 1) * n + j] - q;
      const double c2 = 3 * rise - h * (2 * v + w), c3 = -2 * rise + h * (v + w);
      at_[j] = q + s * (h * v + s * (c2 + s * c3));
      rate_[j] = v + s * (2 * c2 + 3 * s * c3) / h;
    }
    scene_.place(at_.data());
  }

  // Bound on the relative motion of a pair between two times.
  double moved_by(int pair, double a, double b) const {
    const int n = scene_.nv();
    double moved = 0;
    for (int j = 0; j < n; ++j) moved += reach_[pair * n + j] * (travelled(b, j) - travelled(a, j));
    return moved;
  }

  double travelled(double time, int joint) const {
    const int k = step(time), n = scene_.nv();
    const double part = (time - motion_.t[k]) / (motion_.t[k + 1] - motion_.t[k]);
    const double first = motion_.travel[k * n + joint], last = motion_.travel[(k + 1) * n + joint];
    return first + part * (last - first);
  }

  int step(double time) const {
    const auto after = std::upper_bound(motion_.t, motion_.t + motion_.samples, time) - motion_.t;
    return std::clamp(static_cast<int>(after) - 1, 0, motion_.samples - 2);
  }

  Scene& scene_;
  const Motion& motion_;
  const double *required_, *reach_;
  int left_;
  std::vector<double> at_, rate_, ends_, bounds_, exact_;
  double placed_ = std::numeric_limits<double>::quiet_NaN();
  std::set<double> missed_;
  Proof proof_;
};

Proof Scene::prove(const Motion& motion, const double* required, const double* reach, int pieces, int most) {
  return Search(*this, motion, required, reach, pieces, most).run();
}

}  // namespace armdyn
