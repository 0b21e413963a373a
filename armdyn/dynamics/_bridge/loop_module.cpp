// Python bindings of the loop: tables in, tables out.
#include "loop.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>

namespace nb = nanobind;

namespace {

using Table = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using armdyn::CallableSource;

std::vector<double> numbers(const Table& table) { return std::vector<double>(table.data(), table.data() + table.size()); }

template <typename T>
nb::bytes bytes_of(const std::vector<T>& table) {
  return nb::bytes(table.data(), table.size() * sizeof(T));
}

// Scalars of the loop.
void read_scalars(armdyn::LoopProblem& problem, const nb::dict& one) {
  const auto real = [&](const char* name) { return nb::cast<double>(one[name]); };
  problem.period = real("period");
  problem.encoder = real("encoder");
  problem.pole = real("pole");
  problem.integrate_from = real("integrate_from");
  problem.away = real("away");
  problem.fast = real("fast");
  problem.tolerance = real("tolerance");
  problem.ticks = nb::cast<int>(one["ticks"]);
  problem.row_size = nb::cast<int>(one["row_size"]);
  problem.delay = nb::cast<int>(one["delay"]);
  problem.continuous = nb::cast<bool>(one["continuous"]);
  const auto velocity = nb::cast<std::string>(one["velocity"]), antiwindup = nb::cast<std::string>(one["antiwindup"]);
  problem.velocity = velocity == "observer"   ? armdyn::Velocity::observer
                     : velocity == "filtered" ? armdyn::Velocity::filtered
                                              : armdyn::Velocity::exact;
  problem.antiwindup = antiwindup == "conditional"        ? armdyn::Antiwindup::conditional
                       : antiwindup == "back_calculation" ? armdyn::Antiwindup::back_calculation
                                                          : armdyn::Antiwindup::none;
}

void read_tables(armdyn::LoopProblem& problem, const nb::dict& tables) {
  const auto table = [&](const char* name) { return numbers(nb::cast<Table>(tables[name])); };
  problem.plant_parameters = table("plant_parameters");
  problem.model_parameters = table("model_parameters");
  problem.rows = table("rows");
  problem.q_reference = table("q_reference");
  problem.start = table("start");
  problem.first = table("first");
  problem.lower = table("lower");
  problem.upper = table("upper");
  problem.integral_gain = table("integral_gain");
  problem.noise = table("noise");
}

void check_sizes(const armdyn::LoopProblem& problem) {
  const std::size_t nv = problem.lower.size(), ticks = problem.ticks;
  const bool fits = nv > 0 && problem.ticks >= 0 && problem.delay >= 0 && problem.upper.size() == nv &&
                    problem.integral_gain.size() == nv && problem.start.size() == (problem.continuous ? 3 : 2) * nv &&
                    problem.first.size() == nv * problem.delay && !problem.q_reference.empty() &&
                    problem.q_reference.size() % nv == 0 &&
                    problem.row_size > 0 && !problem.rows.empty() && problem.rows.size() % problem.row_size == 0 &&
                    (problem.noise.empty() || problem.noise.size() == nv * ticks);
  if (!fits) throw nb::value_error("tables of the loop do not match each other");
}

nb::dict simulate(const CallableSource& plant, const CallableSource& law, const CallableSource* model,
                  const nb::dict& tables, const nb::dict& scalars) {
  armdyn::LoopProblem problem;
  read_scalars(problem, scalars);
  read_tables(problem, tables);
  check_sizes(problem);
  armdyn::Callable body(plant), decide(law);
  const auto observer = model ? std::make_unique<armdyn::Callable>(*model) : nullptr;
  if (problem.velocity == armdyn::Velocity::observer && !observer) throw nb::value_error("an observer needs a model");
  armdyn::LoopRun run;
  {
    nb::gil_scoped_release others_go_on;
    run = armdyn::run_loop(problem, body, decide, observer.get());
  }
  nb::dict found;
  found["q"] = bytes_of(run.q);
  found["v"] = bytes_of(run.v);
  found["tau"] = bytes_of(run.tau);
  found["estimate"] = bytes_of(run.estimate);
  found["clipped"] = bytes_of(run.clipped);
  found["ticks"] = run.ticks;
  found["shortest"] = run.shortest;
  found["ended"] = run.ended == armdyn::Ended::whole ? "whole" : run.ended == armdyn::Ended::failed ? "failed" : "diverged";
  return found;
}

}  // namespace

void add_loop(nb::module_& m) {
  nb::class_<CallableSource>(m, "Callable", "A function for `simulate`: C at an address, or a serialized casadi Function.")
      .def("__init__", [](CallableSource* self, std::uintptr_t address, std::array<std::size_t, 4> work,
                          std::string serialized) { new (self) CallableSource{address, work, std::move(serialized)}; },
           nb::arg("address"), nb::arg("work"), nb::arg("serialized"));
  m.def("simulate", &simulate, nb::arg("plant"), nb::arg("law"), nb::arg("model").none(), nb::arg("tables"),
        nb::arg("scalars"), "Closed loop of an arm and a controller; see loop.hpp for the names. Releases the GIL.");
}
