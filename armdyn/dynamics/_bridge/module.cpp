// Python bindings: plain numbers in, serialized casadi::Functions out. No objects are exchanged.
#include "symbolic_arm.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace nb = nanobind;

void add_arm(nb::module_& m);   // arm_module.cpp
void add_loop(nb::module_& m);  // loop_module.cpp

namespace {

armdyn::Functions build(std::vector<int> parent, std::vector<bool> prismatic, std::vector<double> axis,
                        std::vector<double> placement, std::vector<double> inertia, std::vector<double> armature,
                        std::vector<double> gravity, int payload_joint) {
  const armdyn::SymbolicArm arm({std::move(parent), std::move(prismatic), std::move(axis), std::move(placement),
                                 std::move(inertia), std::move(armature), std::move(gravity), payload_joint});
  armdyn::Functions functions;
  armdyn::add_forward_dynamics(arm, functions);
  armdyn::add_inverse_dynamics(arm, functions);
  armdyn::add_inertia_and_energy(arm, functions);
  return functions;
}

}  // namespace

NB_MODULE(_armdyn_bridge, m) {
  add_arm(m);
  add_loop(m);
  m.doc() = "Pinocchio's algorithms on casadi::SX and on numbers, motions of an arm, and closed loops.";
  m.attr("casadi_version") = casadi::CasadiMeta::version();
  m.attr("pinocchio_version") = PINOCCHIO_VERSION;
  m.def("build", &build, nb::kw_only(), nb::arg("parent"), nb::arg("prismatic"), nb::arg("axis"),
        nb::arg("placement"), nb::arg("inertia"), nb::arg("armature"), nb::arg("gravity"),
        nb::arg("payload_joint") = -1,
        "Serialized Functions aba, rnea, nle, gravity, crba, kinetic_energy, potential_energy, placements\n"
        "of a tree of revolute and prismatic joints (see tree.hpp for the layout of the arguments).");
}
