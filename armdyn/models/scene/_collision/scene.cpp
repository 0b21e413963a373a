#include "scene.hpp"

#include <algorithm>
#include <limits>

namespace armdyn {

Scene::Scene(std::vector<Joint> joints, std::vector<Solid> solids, std::vector<std::pair<int, int>> pairs,
             std::vector<int> touching)
    : joints_(std::move(joints)),
      solids_(std::move(solids)),
      pairs_(std::move(pairs)),
      touching_(std::move(touching)),
      may_touch_(pairs_.size()),
      frames_(joints_.size() + 1),
      axes_(joints_.size() + 1, Vector::Zero()),
      speeds_(joints_.size() + 1, Vector::Zero()),
      turns_(joints_.size() + 1, Vector::Zero()),
      centers_(solids_.size()),
      carries_((joints_.size() + 1) * joints_.size()),
      distances_(pairs_.size()),
      collisions_(pairs_.size()) {
  for (const int pair : touching_) may_touch_[pair] = 1;
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    char* own = &carries_[(k + 1) * joints_.size()];
    const char* before = &carries_[joints_[k].parent * joints_.size()];
    std::copy(before, before + joints_.size(), own);
    own[k] = 1;
  }
  for (std::size_t k = 0; k < solids_.size(); ++k) {
    centers_[k] = solids_[k].centers;
    Solid& solid = solids_[k];
    for (const Vector& center : solid.centers) solid.middle += center / static_cast<double>(solid.centers.size());
    for (const Vector& center : solid.centers)
      solid.around = std::max(solid.around, (center - solid.middle).norm() + solid.ball);
    middles_.push_back(solid.middle);
  }
  const std::vector<double> nowhere(joints_.size(), 0.0);
  place(nowhere.data());
}

void Scene::place(const double* q) {
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const Joint& joint = joints_[k];
    const Place& parent = frames_[joint.parent];
    Place& own = frames_[k + 1];
    own.turn = parent.turn * joint.placement.turn;
    own.at = parent.turn * joint.placement.at + parent.at;
    axes_[k + 1] = own.turn * joint.axis;
    if (joint.slides)
      own.at += q[k] * axes_[k + 1];
    else
      own.turn = own.turn * Eigen::AngleAxisd(q[k], joint.axis).toRotationMatrix();
  }
  for (std::size_t k = 0; k < solids_.size(); ++k) {
    if (!solids_[k].joint) continue;
    const Place& joint = frames_[solids_[k].joint];
    middles_[k] = world(joint, solids_[k].middle);
    for (std::size_t i = 0; i < solids_[k].centers.size(); ++i) centers_[k][i] = world(joint, solids_[k].centers[i]);
  }
}

void Scene::move(const double* v) {
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const int parent = joints_[k].parent;
    turns_[k + 1] = turns_[parent];
    speeds_[k + 1] = speeds_[parent] + turns_[parent].cross(frames_[k + 1].at - frames_[parent].at);
    (joints_[k].slides ? speeds_ : turns_)[k + 1] += v[k] * axes_[k + 1];
  }
}

coal::Transform3s Scene::placed(const Solid& solid) const {
  const Place& joint = frames_[solid.joint];
  const Matrix turn = joint.turn * solid.placement.turn;
  return coal::Transform3s(turn, world(joint, solid.placement.at));
}

double Scene::away(const Solid& box, const Vector& point) const {
  const Vector own = box.placement.turn.transpose() * (point - box.placement.at);
  return (own - own.cwiseMin(box.upper).cwiseMax(box.lower)).squaredNorm();
}

double Scene::bound(int pair) const {
  const auto [i, j] = pairs_[pair];
  const Solid &first = solids_[i], &second = solids_[j];
  double least = std::numeric_limits<double>::infinity();
  if (second.centers.empty()) {
    for (const Vector& a : centers_[i]) least = std::min(least, away(second, a));
    return std::sqrt(least) - first.ball;
  }
  for (const Vector& a : centers_[i])
    for (const Vector& b : centers_[j]) least = std::min(least, (a - b).squaredNorm());
  return std::sqrt(least) - first.ball - second.ball;
}

// Whether one ball around each of the two shows that they do not overlap.
bool Scene::far(int pair) const {
  const auto [i, j] = pairs_[pair];
  const Solid &first = solids_[i], &second = solids_[j];
  const double reach = first.around + second.around;
  const double apart = second.centers.empty() ? away(second, middles_[i]) : (middles_[i] - middles_[j]).squaredNorm();
  return apart > reach * reach;
}

void Scene::bounds(double* out) const {
  for (int k = 0; k < pairs(); ++k) out[k] = bound(k);
}

bool Scene::overlaps(int pair) {
  if (may_touch_[pair] || far(pair) || bound(pair) > 0) return false;
  const Solid &first = solids_[pairs_[pair].first], &second = solids_[pairs_[pair].second];
  auto& compute = collisions_[pair];
  if (!compute) compute = std::make_unique<coal::ComputeCollision>(first.shape.get(), second.shape.get());
  coal::CollisionRequest request(coal::NO_REQUEST, 1);
  request.enable_contact = false;
  coal::CollisionResult result;
  return (*compute)(placed(first), placed(second), request, result) > 0;
}

bool Scene::is_free(const double* q, const double* least) {
  place(q);
  if (pairs_.empty()) return true;
  if (overlaps(last_hit_)) return false;
  for (int k = 0; k < pairs(); ++k)
    if (k != last_hit_ && overlaps(k)) {
      last_hit_ = k;
      return false;
    }
  for (std::size_t k = 0; k < touching_.size(); ++k)
    if (distance(touching_[k]).distance < least[k]) return false;
  return true;
}

Witness Scene::distance(int pair) {
  const Solid &first = solids_[pairs_[pair].first], &second = solids_[pairs_[pair].second];
  auto& compute = distances_[pair];
  if (!compute) compute = std::make_unique<coal::ComputeDistance>(first.shape.get(), second.shape.get());
  const coal::DistanceRequest request;
  coal::DistanceResult result;
  (*compute)(placed(first), placed(second), request, result);
  return {result.min_distance, result.normal, result.nearest_points[0], result.nearest_points[1]};
}

void Scene::gradient(int pair, const Witness& at, double* out) const {
  const auto [i, j] = pairs_[pair];
  const char* first = &carries_[solids_[i].joint * joints_.size()];
  const char* second = &carries_[solids_[j].joint * joints_.size()];
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const Vector &axis = axes_[k + 1], &origin = frames_[k + 1].at;
    const auto along = [&](const Vector& point) {
      return at.normal.dot(joints_[k].slides ? axis : axis.cross(point - origin));
    };
    out[k] = (second[k] ? along(at.second) : 0.0) - (first[k] ? along(at.first) : 0.0);
  }
}

double Scene::gap(int pair, const Vector& given, double time) const {
  const Solid* both[] = {&solids_[pairs_[pair].first], &solids_[pairs_[pair].second]};
  Vector normal = given;  // in any other direction a half space is unbounded
  for (int side = 0; side < 2; ++side)
    if (both[side]->half_space) normal = (side ? -1.0 : 1.0) * both[side]->outward;
  double out = 0;
  for (int side = 0; side < 2; ++side) {
    const Solid& solid = *both[side];
    const Place& joint = frames_[solid.joint];
    // n . (w x r) = (n x w) . r: one direction serves all points of a solid.
    const Vector ahead = joint.turn.transpose() * (normal + time * normal.cross(turns_[solid.joint]));
    const double base = normal.dot(joint.at + time * speeds_[solid.joint]);
    const Eigen::RowVectorXd along = ahead.transpose() * solid.points;
    out += side ? base + along.minCoeff() : -base - along.maxCoeff();
    out -= solid.radius;
  }
  return out;
}

}  // namespace armdyn
