#include "symbolic_arm.hpp"

#include <pinocchio/algorithm/aba.hpp>

namespace armdyn {

void add_forward_dynamics(const SymbolicArm& arm, Functions& out) {
  Data data(arm.model);
  const Vector a = pinocchio::aba(arm.model, data, arm.q, arm.v, arm.tau, pinocchio::Convention::LOCAL);
  out["aba"] =
      arm.function("aba", {to_sx(arm.q), to_sx(arm.v), to_sx(arm.tau)}, {"q", "v", "tau"}, to_sx(a), "a");
}

}  // namespace armdyn
