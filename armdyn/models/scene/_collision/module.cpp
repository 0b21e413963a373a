// Python bindings: arrays in, arrays out. They release the GIL.
#include "planner.hpp"

#include <coal/config.hh>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <string>

namespace nb = nanobind;

namespace {

using Table = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Wholes = nb::ndarray<const long, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Numbers = std::vector<double>;
using armdyn::Scene;
using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

struct Holder {
  armdyn::Shape shape;
};

void expect(bool fits) {
  if (!fits) throw nb::value_error("the arrays do not match each other or the scene");
}

template <typename Number>
nb::object array(std::vector<Number> values, std::vector<std::size_t> shape) {
  auto* own = new std::vector<Number>(std::move(values));
  nb::capsule owner(own, [](void* p) noexcept { delete static_cast<std::vector<Number>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, Number>(own->data(), shape.size(), shape.data(), owner));
}

armdyn::Vector vector(const double* at) { return armdyn::Vector(at); }

// Rotation by rows, then translation.
armdyn::Place place(const double* at) { return {Eigen::Map<const RowMatrix>(at), vector(at + 9)}; }

armdyn::Points columns(const Table& points) {
  expect(points.ndim() == 2 && points.shape(1) == 3);
  return Eigen::Map<const armdyn::Points>(points.data(), 3, points.shape(0));
}

Holder shape(const std::string& kind, const Table& sizes) {
  const double* at = sizes.data();
  if (kind == "convex") {
    const armdyn::Points points = columns(sizes);
    auto kept = std::make_shared<std::vector<coal::Vec3s>>();
    for (int k = 0; k < points.cols(); ++k) kept->push_back(points.col(k));
    return {armdyn::Shape(coal::ConvexBase::convexHull(kept, static_cast<unsigned>(points.cols()), true, "Qt"))};
  }
  const std::pair<const char*, std::size_t> kinds[] = {
      {"box", 3}, {"sphere", 1}, {"capsule", 2}, {"cylinder", 2}, {"half space", 4}};
  for (const auto& [name, count] : kinds)
    if (kind == name) expect(sizes.size() == count);
  if (kind == "box") return {std::make_shared<coal::Box>(2 * at[0], 2 * at[1], 2 * at[2])};
  if (kind == "sphere") return {std::make_shared<coal::Sphere>(at[0])};
  if (kind == "capsule") return {std::make_shared<coal::Capsule>(at[0], 2 * at[1])};
  if (kind == "cylinder") return {std::make_shared<coal::Cylinder>(at[0], 2 * at[1])};
  if (kind == "half space") return {std::make_shared<coal::Halfspace>(vector(at), at[3])};
  throw nb::value_error("no such shape");
}

std::vector<armdyn::Joint> joints(const nb::dict& tree) {
  const auto parent = nb::cast<std::vector<int>>(tree["parent"]);
  const auto slides = nb::cast<std::vector<bool>>(tree["prismatic"]);
  const auto axis = nb::cast<Table>(tree["axis"]), placement = nb::cast<Table>(tree["placement"]);
  const std::size_t n = parent.size();
  expect(slides.size() == n && axis.size() == 3 * n && placement.size() == 12 * n);
  std::vector<armdyn::Joint> out;
  for (std::size_t k = 0; k < n; ++k) {
    expect(parent[k] >= -1 && parent[k] < static_cast<int>(k));
    out.push_back({parent[k] + 1, slides[k], vector(axis.data() + 3 * k), place(placement.data() + 12 * k)});
  }
  return out;
}

armdyn::Solid solid(const nb::dict& given, std::size_t joints) {
  armdyn::Solid out;
  out.shape = nb::cast<Holder&>(given["shape"]).shape;
  out.joint = nb::cast<int>(given["joint"]);
  const auto placement = nb::cast<Table>(given["placement"]), centers = nb::cast<Table>(given["centers"]);
  const auto outward = nb::cast<Table>(given["outward"]), box = nb::cast<Table>(given["box"]);
  expect(out.joint >= 0 && out.joint <= static_cast<int>(joints) && placement.size() == 12);
  out.placement = place(placement.data());
  out.points = columns(nb::cast<Table>(given["points"]));
  out.radius = nb::cast<double>(given["radius"]);
  out.half_space = outward.size() == 3;
  if (out.half_space) out.outward = vector(outward.data());
  const armdyn::Points balls = columns(centers);
  for (int k = 0; k < balls.cols(); ++k) out.centers.push_back(balls.col(k));
  out.ball = nb::cast<double>(given["ball"]);
  expect(out.points.cols() > 0 && (box.size() == 6 || centers.size() > 0));
  if (box.size() == 6) out.lower = vector(box.data()), out.upper = vector(box.data() + 3);
  return out;
}

// Number of poses.
std::size_t poses(const Scene& scene, const Table& q) {
  expect(q.ndim() == 2 && q.shape(1) == static_cast<std::size_t>(scene.nv()));
  return q.shape(0);
}

void known(const Scene& scene, const Wholes& pairs) {
  for (std::size_t k = 0; k < pairs.size(); ++k) expect(pairs.data()[k] >= 0 && pairs.data()[k] < scene.pairs());
}

std::size_t first_hit(Scene& scene, const Table& q, const Table& least) {
  const std::size_t count = poses(scene, q);
  expect(least.size() == static_cast<std::size_t>(scene.touching()));
  nb::gil_scoped_release others_go_on;
  for (std::size_t k = 0; k < count; ++k)
    if (!scene.is_free(q.data() + k * scene.nv(), least.data())) return k;
  return count;
}

nb::object distances(Scene& scene, const Table& q, double within) {
  const std::size_t count = poses(scene, q), pairs = scene.pairs();
  Numbers out(count * pairs);
  {
    nb::gil_scoped_release others_go_on;
    for (std::size_t k = 0; k < count; ++k) {
      double* here = &out[k * pairs];
      scene.place(q.data() + k * scene.nv());
      scene.bounds(here);
      for (int pair = 0; pair < scene.pairs(); ++pair)
        if (here[pair] <= within) here[pair] = scene.distance(pair).distance;
    }
  }
  return array(std::move(out), {count, pairs});
}

nb::object distances_of(Scene& scene, const Wholes& pairs, const Table& q) {
  const std::size_t count = poses(scene, q), width = pairs.size();
  known(scene, pairs);
  Numbers out(count * width);
  {
    nb::gil_scoped_release others_go_on;
    for (std::size_t k = 0; k < count; ++k) {
      scene.place(q.data() + k * scene.nv());
      for (std::size_t i = 0; i < width; ++i)
        out[k * width + i] = scene.distance(static_cast<int>(pairs.data()[i])).distance;
    }
  }
  return array(std::move(out), {count, width});
}

nb::tuple near(Scene& scene, const Table& q, double within, std::size_t most) {
  const std::size_t count = poses(scene, q), n = scene.nv();
  std::vector<long> of_pose, of_pair;
  Numbers found, gradients;
  {
    nb::gil_scoped_release others_go_on;
    Numbers bounds(scene.pairs());
    std::vector<std::pair<double, int>> order;
    std::vector<std::pair<double, std::pair<int, armdyn::Witness>>> here;
    const auto by_distance = [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first < b.first : a.second.first < b.second.first;
    };
    for (std::size_t k = 0; k < count; ++k) {
      scene.place(q.data() + k * n);
      scene.bounds(bounds.data());
      order.clear();
      here.clear();
      for (int pair = 0; pair < scene.pairs(); ++pair)
        if (bounds[pair] <= within) order.push_back({bounds[pair], pair});
      std::sort(order.begin(), order.end());
      for (const auto& [bound, pair] : order) {
        if (here.size() == most && (!most || bound > here.back().first)) break;
        const armdyn::Witness at = scene.distance(pair);
        if (at.distance > within) continue;
        const std::pair<double, std::pair<int, armdyn::Witness>> one{at.distance, {pair, at}};
        here.insert(std::upper_bound(here.begin(), here.end(), one, by_distance), one);
        if (here.size() > most) here.pop_back();
      }
      for (const auto& [distance, one] : here) {
        of_pose.push_back(static_cast<long>(k));
        of_pair.push_back(one.first);
        found.push_back(distance);
        gradients.resize(gradients.size() + n);
        scene.gradient(one.first, one.second, &gradients[gradients.size() - n]);
      }
    }
  }
  const std::size_t rows = found.size();
  return nb::make_tuple(array(std::move(of_pose), {rows}), array(std::move(of_pair), {rows}),
                        array(std::move(found), {rows}), array(std::move(gradients), {rows, n}));
}

// Distance and nearest points of one pair.
nb::tuple witness(Scene& scene, long pair, const Table& q) {
  expect(pair >= 0 && pair < scene.pairs() && poses(scene, q) == 1);
  scene.place(q.data());
  const armdyn::Witness at = scene.distance(static_cast<int>(pair));
  Numbers points(at.first.data(), at.first.data() + 3);
  points.insert(points.end(), at.second.data(), at.second.data() + 3);
  return nb::make_tuple(at.distance, array(std::move(points), {2, 3}));
}

nb::tuple prove(Scene& scene, const Table& t, const Table& q, const Table& v, const Table& travel,
                const Table& acceleration, const Table& required, const Table& reach, int pieces, int most) {
  const std::size_t samples = t.size(), n = scene.nv(), pairs = scene.pairs();
  expect(samples > 1 && poses(scene, q) == samples && v.size() == samples * n && travel.size() == samples * n &&
         acceleration.size() == (samples - 1) * (n + 1) && required.size() == pairs && reach.size() == pairs * n &&
         pieces > 0 && pairs > 0);
  const armdyn::Motion motion{static_cast<int>(samples), t.data(), q.data(), v.data(), travel.data(),
                              acceleration.data()};
  armdyn::Proof proof;
  {
    nb::gil_scoped_release others_go_on;
    proof = scene.prove(motion, required.data(), reach.data(), pieces, most);
  }
  const std::size_t missed = proof.missed.size();
  return nb::make_tuple(proof.sure, array(std::move(proof.missed), {missed}), proof.pair, proof.time);
}

armdyn::Randoms randoms(const Table& numbers, std::size_t columns) {
  expect(numbers.ndim() == 2 && numbers.shape(1) == columns);
  return {numbers.data(), static_cast<Eigen::Index>(numbers.shape(0)), static_cast<Eigen::Index>(columns)};
}

// A shortened path, empty if none was found, and the number of its collision checks.
nb::tuple plan(Scene& scene, const Table& frame, const Table& least, const Table& random, const Table& cuts,
               std::pair<double, double> lengths, std::pair<long, long> checks, std::function<bool()> stop) {
  const std::size_t n = scene.nv();
  expect(poses(scene, frame) == 5 && least.size() == static_cast<std::size_t>(scene.touching()));
  const auto row = [&](int k) { return armdyn::Point(Eigen::Map<const armdyn::Point>(frame.data() + k * n, n)); };
  const armdyn::JointSpace space{row(0), row(1), row(2), row(3), row(4), least.data(), lengths.first, lengths.second};
  const armdyn::Randoms targets = randoms(random, n), shortcuts = randoms(cuts, 2);
  const auto polled = [&] {
    nb::gil_scoped_acquire here;
    return stop();
  };
  armdyn::Planner planner(scene, space, checks.second, polled);
  Numbers points;
  {
    nb::gil_scoped_release others_go_on;
    armdyn::Path path = planner.connect(targets, checks.first);
    if (!path.empty()) planner.shorten(path, shortcuts, checks.first);
    for (const armdyn::Point& point : path) points.insert(points.end(), point.data(), point.data() + n);
  }
  const std::size_t count = points.size() / n;
  return nb::make_tuple(array(std::move(points), {count, n}), planner.used());
}

}  // namespace

NB_MODULE(_armdyn_collision, m) {
  m.attr("coal_version") = COAL_VERSION;
  nb::class_<Holder>(m, "Shape", "Convex geometry of coal; see scene.hpp.");
  m.def("shape", &shape, nb::arg("kind"), nb::arg("sizes"));
  nb::class_<Scene>(m, "Scene", "Distances between solids, for one thread; see scene.hpp.")
      .def("__init__",
           [](Scene* self, const nb::dict& tree, const std::vector<nb::dict>& solids,
              std::vector<std::pair<int, int>> pairs, std::vector<int> touching) {
             auto own = joints(tree);
             std::vector<armdyn::Solid> all;
             for (const nb::dict& each : solids) all.push_back(solid(each, own.size()));
             const int count = static_cast<int>(all.size());
             for (const auto& [i, j] : pairs) expect(i >= 0 && i < count && j >= 0 && j < count && !all[i].centers.empty());
             for (const int k : touching) expect(k >= 0 && k < static_cast<int>(pairs.size()));
             new (self) Scene(std::move(own), std::move(all), std::move(pairs), std::move(touching));
           },
           nb::arg("tree"), nb::arg("solids"), nb::arg("pairs"), nb::arg("touching"))
      .def("first_hit", &first_hit, nb::arg("q"), nb::arg("least"))
      .def("distances", &distances, nb::arg("q"), nb::arg("within"))
      .def("distances_of", &distances_of, nb::arg("pairs"), nb::arg("q"))
      .def("near", &near, nb::arg("q"), nb::arg("within"), nb::arg("most"))
      .def("witness", &witness, nb::arg("pair"), nb::arg("q"))
      .def("plan", &plan, nb::arg("frame"), nb::arg("least"), nb::arg("random"), nb::arg("cuts"), nb::arg("lengths"),
           nb::arg("checks"), nb::arg("stop"))
      .def("prove", &prove, nb::arg("t"), nb::arg("q"), nb::arg("v"), nb::arg("travel"), nb::arg("acceleration"),
           nb::arg("required"), nb::arg("reach"), nb::arg("pieces"), nb::arg("most"));
}
