#include "symbolic_arm.hpp"

#include <pinocchio/algorithm/rnea.hpp>

namespace armdyn {

void add_inverse_dynamics(const SymbolicArm& arm, Functions& out) {
  const SX q = to_sx(arm.q), v = to_sx(arm.v), a = to_sx(arm.a);
  {
    Data data(arm.model);
    const Vector tau = pinocchio::rnea(arm.model, data, arm.q, arm.v, arm.a);
    out["rnea"] = arm.function("rnea", {q, v, a}, {"q", "v", "a"}, to_sx(tau), "tau");
  }
  {
    Data data(arm.model);
    const Vector nle = pinocchio::nonLinearEffects(arm.model, data, arm.q, arm.v);
    out["nle"] = arm.function("nle", {q, v}, {"q", "v"}, to_sx(nle), "nle");
  }
  {
    Data data(arm.model);
    const Vector g = pinocchio::computeGeneralizedGravity(arm.model, data, arm.q);
    out["gravity"] = arm.function("gravity", {q}, {"q"}, to_sx(g), "gravity");
  }
}

}  // namespace armdyn
