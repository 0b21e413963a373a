// Python bindings of the numeric arm: arrays in, arrays out. They release the GIL.
#include "motion.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <utility>

namespace nb = nanobind;

namespace {

using Table = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::c_contig, nb::device::cpu>;
using Numbers = std::vector<double>;
using armdyn::Arm;

Numbers numbers(const Table& table) { return Numbers(table.data(), table.data() + table.size()); }

nb::object array(Numbers values, std::vector<std::size_t> shape) {
  auto* own = new Numbers(std::move(values));
  nb::capsule owner(own, [](void* p) noexcept { delete static_cast<Numbers*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, double>(own->data(), shape.size(), shape.data(), owner));
}

std::vector<std::size_t> shape_of(const Table& table, std::vector<std::size_t> more = {}) {
  std::vector<std::size_t> shape;
  for (std::size_t i = 0; i < table.ndim(); ++i) shape.push_back(table.shape(i));
  shape.insert(shape.end(), more.begin(), more.end());
  return shape;
}

void expect(bool fits) {
  if (!fits) throw nb::value_error("the arrays do not match each other or the arm's joints");
}

// Number of states; every table has one row per state.
std::size_t states(const Arm& arm, std::initializer_list<const Table*> tables) {
  const std::size_t size = (*tables.begin())->size();
  for (const Table* each : tables) expect(each->size() == size);
  expect(size % arm.nv() == 0);
  return size / arm.nv();
}

using StateFunction = void (Arm::*)(const double*, const double*, const double*, double*);

template <StateFunction function>
nb::object along(Arm& arm, const Table& q, const Table& v, const Table& third) {
  const std::size_t count = states(arm, {&q, &v, &third}), n = arm.nv();
  Numbers out(count * n);
  {
    nb::gil_scoped_release others_go_on;
    for (std::size_t k = 0; k < out.size(); k += n)
      (arm.*function)(q.data() + k, v.data() + k, third.data() + k, &out[k]);
  }
  return array(std::move(out), shape_of(third));
}

nb::object inertia(Arm& arm, const Table& q) {
  const std::size_t count = states(arm, {&q}), n = arm.nv();
  Numbers out(count * n * n);
  {
    nb::gil_scoped_release others_go_on;
    for (std::size_t k = 0; k < count; ++k) arm.inertia(q.data() + k * n, &out[k * n * n]);
  }
  return array(std::move(out), shape_of(q, {n}));
}

nb::tuple derivatives(Arm& arm, const Table& q, const Table& v, const Table& tau) {
  const std::size_t count = states(arm, {&q, &v, &tau}), n = arm.nv(), square = n * n;
  Numbers a(count * n), by_q(count * square), by_v(count * square), by_tau(count * square);
  {
    nb::gil_scoped_release others_go_on;
    for (std::size_t k = 0; k < count; ++k)
      arm.derivatives(q.data() + k * n, v.data() + k * n, tau.data() + k * n, &a[k * n], &by_q[k * square],
                      &by_v[k * square], &by_tau[k * square]);
  }
  const auto matrices = shape_of(tau, {n});
  return nb::make_tuple(array(std::move(a), shape_of(tau)), array(std::move(by_q), matrices),
                        array(std::move(by_v), matrices), array(std::move(by_tau), matrices));
}

armdyn::SampledTorques sampled(const Arm& arm, const Table& t, const Table& tau, const Table& tau_end,
                               const Flags& jumps) {
  const std::size_t samples = t.size(), n = arm.nv();
  expect(samples > 1 && tau.size() == samples * n && tau_end.size() == (samples - 1) * n && jumps.size() == samples - 1);
  return {numbers(t), numbers(tau), numbers(tau_end), {jumps.data(), jumps.data() + jumps.size()}};
}

nb::object replay(Arm& arm, const armdyn::ExplicitMethod& method, const Table& t, const Table& tau,
                  const Table& tau_end, const Flags& jumps, const Table& x, double rtol, long spare) {
  const auto torques = sampled(arm, t, tau, tau_end, jumps);
  const std::size_t width = 2 * arm.nv();
  Numbers start = numbers(x), states;
  expect(start.size() == width);
  {
    nb::gil_scoped_release others_go_on;
    states = armdyn::replay(arm, method, torques, std::move(start), rtol, spare);
  }
  const std::size_t count = states.size() / width;
  return array(std::move(states), {count, width});
}

nb::tuple track(Arm& arm, const armdyn::ExplicitMethod& method, const Table& t, const Table& tau, const Flags& jumps,
                const Table& desired, const Table& fade, double bandwidth, int clips,
                const std::vector<Table>& range, const Table& x, double rtol, long spare) {
  const std::size_t n = arm.nv(), samples = t.size(), width = 2 * n;
  expect(samples > 1 && tau.size() == samples * n && jumps.size() == samples - 1 && fade.size() == samples - 1 &&
         desired.size() == samples * width && x.size() == width && range.size() == 4 && range[0].size() == n &&
         range[1].size() == n && range[2].size() == range[3].size() && range[2].size() % n == 0);
  armdyn::SampledTorques torques{numbers(t), numbers(tau), {}, {jumps.data(), jumps.data() + jumps.size()}};
  const armdyn::Tracking tracking{numbers(desired), numbers(fade), bandwidth, clips};
  const armdyn::TorqueRange limits{numbers(range[0]), numbers(range[1]), numbers(range[2]), numbers(range[3])};
  Numbers start = numbers(x), states;
  {
    nb::gil_scoped_release others_go_on;
    states = armdyn::track(arm, method, torques, tracking, limits, std::move(start), rtol, spare);
  }
  const std::size_t count = states.size() / width;
  return nb::make_tuple(array(std::move(states), {count, width}), array(std::move(torques.tau), {samples, n}));
}

nb::tuple implicit_steps(Arm& arm, const armdyn::ImplicitMethod& method, const Table& h, const Table& x,
                         const Table& tau, int parts) {
  const std::size_t n = arm.nv(), count = h.size();
  expect(x.size() == 2 * n * count && tau.size() == 2 * n * count && parts > 0);
  const Numbers lengths = numbers(h), starts = numbers(x), torques = numbers(tau);
  armdyn::ImplicitSteps out;
  {
    nb::gil_scoped_release others_go_on;
    out = armdyn::implicit_steps(arm, method, lengths, starts, torques, parts);
  }
  return nb::make_tuple(array(std::move(out.end), {count, 2 * n}),
                        array(std::move(out.state_transition), {count, 2 * n, 2 * n}),
                        array(std::move(out.forced), {count, 2 * n, n}));
}

}  // namespace

void add_arm(nb::module_& m) {
  nb::class_<armdyn::ExplicitMethod>(m, "ExplicitMethod", "Explicit Runge-Kutta method; see motion.hpp.")
      .def("__init__",
           [](armdyn::ExplicitMethod* self, const Table& A, const Table& b, const Table& c, const Table& error3,
              const Table& error5) {
             const std::size_t s = b.size();
             expect(A.size() == s * s && c.size() == s && error3.size() == s + 1 && error5.size() == s + 1);
             new (self) armdyn::ExplicitMethod{s, numbers(A), numbers(b), numbers(c), numbers(error3), numbers(error5)};
           });
  nb::class_<armdyn::ImplicitMethod>(m, "ImplicitMethod", "Collocation method; see motion.hpp.")
      .def("__init__",
           [](armdyn::ImplicitMethod* self, const Table& A, const Table& b, const Table& c, double tolerance,
              double stalled, int most) {
             const std::size_t s = b.size();
             expect(A.size() == s * s && c.size() == s);
             new (self) armdyn::ImplicitMethod{s, numbers(A), numbers(b), numbers(c), tolerance, stalled, most};
           });
  nb::class_<Arm>(m, "Arm", "Numeric dynamics of a tree with friction, for one thread; see arm.hpp and motion.hpp.")
      .def("__init__",
           [](Arm* self, std::vector<int> parent, std::vector<bool> prismatic, const Table& axis,
              const Table& placement, const Table& inertia, const Table& armature, const Table& gravity,
              const Table& damping, const Table& coulomb, const Table& width) {
             new (self) Arm({std::move(parent), std::move(prismatic), numbers(axis), numbers(placement),
                             numbers(inertia), numbers(armature), numbers(gravity)},
                            {numbers(damping), numbers(coulomb), numbers(width)});
           },
           nb::kw_only(), nb::arg("parent"), nb::arg("prismatic"), nb::arg("axis"), nb::arg("placement"),
           nb::arg("inertia"), nb::arg("armature"), nb::arg("gravity"), nb::arg("damping"), nb::arg("coulomb"),
           nb::arg("width"))
      .def("acceleration", &along<&Arm::acceleration>, nb::arg("q"), nb::arg("v"), nb::arg("tau"))
      .def("torque", &along<&Arm::torque>, nb::arg("q"), nb::arg("v"), nb::arg("a"))
      .def("inertia", &inertia, nb::arg("q"))
      .def("derivatives", &derivatives, nb::arg("q"), nb::arg("v"), nb::arg("tau"))
      .def("replay", &replay, nb::arg("method"), nb::arg("t"), nb::arg("tau"), nb::arg("tau_end"), nb::arg("jumps"),
           nb::arg("x"), nb::arg("rtol"), nb::arg("spare"))
      .def("track", &track, nb::arg("method"), nb::arg("t"), nb::arg("tau"), nb::arg("jumps"), nb::arg("desired"),
           nb::arg("fade"), nb::arg("bandwidth"), nb::arg("clips"), nb::arg("range"), nb::arg("x"), nb::arg("rtol"),
           nb::arg("spare"))
      .def("implicit_steps", &implicit_steps, nb::arg("method"), nb::arg("h"), nb::arg("x"), nb::arg("tau"),
           nb::arg("parts"));
}
