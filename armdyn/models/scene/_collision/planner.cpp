#include "planner.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {
namespace {

constexpr long kBetweenStops = 1000;  // checks between polls of the stopping condition: some 5 ms
constexpr double kWorth = 1e-3;       // least saving of a shortcut, as a part of its length

struct OutOfChecks {};

}  // namespace

// Tree of points, each with its parent.
class Planner::Tree {
 public:
  explicit Tree(const Point& root) : size_(root.size()) { add(root, -1); }

  int add(const Point& point, int parent) {
    points_.insert(points_.end(), point.data(), point.data() + size_);
    parents_.push_back(parent);
    return static_cast<int>(parents_.size()) - 1;
  }
  int nearest(const Point& to) const {
    int best = 0;
    double least = std::numeric_limits<double>::infinity();
    const double* point = points_.data();
    for (int k = 0; k < static_cast<int>(parents_.size()); ++k, point += size_) {
      double sum = 0.0;
      for (Eigen::Index i = 0; i < size_; ++i) sum += (point[i] - to[i]) * (point[i] - to[i]);
      if (sum < least) least = sum, best = k;
    }
    return best;
  }
  Point operator[](int index) const { return Eigen::Map<const Point>(points_.data() + index * size_, size_); }

  // Points from a given one to the root.
  Path path(int index) const {
    Path out;
    for (; index >= 0; index = parents_[index]) out.push_back((*this)[index]);
    return out;
  }

 private:
  Eigen::Index size_;
  std::vector<double> points_;
  std::vector<int> parents_;
};

void Planner::begin(long checks) { left_ = std::min(checks, budget_ - used_); }

bool Planner::is_free(const Point& point) {
  if (left_ == 0 || (used_ % kBetweenStops == 0 && stop_())) throw OutOfChecks();
  --left_;
  ++used_;
  q_ = point.cwiseProduct(space_.speed);
  return scene_.is_free(q_.data(), space_.least);
}

// Points between a and b are checked from coarse to fine.
bool Planner::segment_is_free(const Point& a, const Point& b) {
  const Point way = b - a;
  const int count = static_cast<int>(std::ceil(way.cwiseAbs().maxCoeff() / space_.step));
  int coarse = 1;
  while (2 * coarse < count) coarse *= 2;
  for (; coarse > 0; coarse /= 2)
    for (int k = coarse; k < count; k += 2 * coarse)
      if (!is_free(a + way * static_cast<double>(k) / count)) return false;
  return true;
}

Planner::Grown Planner::extend(Tree& tree, const Point& target, bool far) {
  int index = tree.nearest(target);
  const Point root = tree[index], way = target - root;
  const double length = way.norm(), part = far ? 1.0 : std::min(1.0, space_.reach / length);
  if (length == 0) return {index, true};
  const int count = std::max(static_cast<int>(std::ceil(part * way.cwiseAbs().maxCoeff() / space_.step)), 1);
  const int between = std::max(static_cast<int>(space_.reach / (part * length / count)), 1);
  const auto point = [&](int k) -> Point { return root + way * (part * k / count); };
  int free = 0;
  while (free < count && is_free(point(free + 1))) ++free;
  for (int k = between; k < std::min(free + 1, count); k += between) index = tree.add(point(k), index);
  if (free == count) return {tree.add(point(count), index), part == 1.0};
  return {free ? tree.add(point(free), index) : -1, false};
}

Path Planner::connect(const Randoms& random, long checks) {
  begin(checks);
  const Point size = space_.upper - space_.lower;
  Tree from_start(space_.start), from_goal(space_.goal);
  Tree *growing = &from_start, *other = &from_goal;
  try {
    if (segment_is_free(space_.start, space_.goal)) return {space_.start, space_.goal};
    for (Eigen::Index k = 0; k < random.rows(); ++k, std::swap(growing, other)) {
      const Grown added = extend(*growing, space_.lower + size.cwiseProduct(random.row(k).transpose()), false);
      if (added.index < 0) continue;
      const Grown met = extend(*other, (*growing)[added.index], true);
      if (!met.hit) continue;
      Path out = growing->path(added.index), rest = other->path(met.index);
      std::reverse(out.begin(), out.end());
      out.insert(out.end(), rest.begin() + 1, rest.end());
      if (growing != &from_start) std::reverse(out.begin(), out.end());
      return out;
    }
  } catch (const OutOfChecks&) {
  }
  return {};
}

void Planner::shorten(Path& path, const Randoms& random, long checks) {
  begin(checks);
  try {
    for (Eigen::Index row = 0; row < random.rows(); ++row) {
      std::vector<double> marks{0.0};
      for (std::size_t k = 1; k < path.size(); ++k)
        marks.push_back(marks.back() + (path[k] - path[k - 1]).cwiseAbs().maxCoeff());
      const double cut = marks.back() * random(row, 0), other = marks.back() * random(row, 1);
      const double first = std::min(cut, other), last = std::max(cut, other);
      const auto segment = [&](double at) {
        const auto next = std::upper_bound(marks.begin(), marks.end(), at) - marks.begin();
        return std::clamp<std::ptrdiff_t>(next - 1, 0, static_cast<std::ptrdiff_t>(path.size()) - 2);
      };
      const auto point = [&](std::ptrdiff_t k, double at) -> Point {
        return path[k] + (path[k + 1] - path[k]) * (at - marks[k]) / std::max(marks[k + 1] - marks[k], 1e-12);
      };
      const std::ptrdiff_t i = segment(first), j = segment(last);
      const Point a = point(i, first), b = point(j, last);
      if (i == j || (b - a).cwiseAbs().maxCoeff() >= (1 - kWorth) * (last - first) || !segment_is_free(a, b)) continue;
      path.erase(path.begin() + i + 1, path.begin() + j + 1);
      path.insert(path.begin() + i + 1, {a, b});
    }
  } catch (const OutOfChecks&) {
  }
}

}  // namespace armdyn
