#include "symbolic_arm.hpp"

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/energy.hpp>
#include <pinocchio/algorithm/kinematics.hpp>

namespace armdyn {

void add_inertia_and_energy(const SymbolicArm& arm, Functions& out) {
  const SX q = to_sx(arm.q), v = to_sx(arm.v);
  {
    Data data(arm.model);
    pinocchio::crba(arm.model, data, arm.q, pinocchio::Convention::LOCAL);
    // crba fills the upper triangle only.
    out["crba"] = arm.function("crba", {q}, {"q"}, SX::triu2symm(SX::triu(to_sx(data.M))), "inertia");
  }
  {
    Data data(arm.model);
    const SX energy = pinocchio::computeKineticEnergy(arm.model, data, arm.q, arm.v);
    out["kinetic_energy"] = arm.function("kinetic_energy", {q, v}, {"q", "v"}, energy, "energy");
  }
  {
    Data data(arm.model);
    const SX energy = pinocchio::computePotentialEnergy(arm.model, data, arm.q);
    out["potential_energy"] = arm.function("potential_energy", {q}, {"q"}, energy, "energy");
  }
  {
    // Joint i: columns 4 i .. 4 i + 3 are its rotation and its origin in the world.
    Data data(arm.model);
    pinocchio::forwardKinematics(arm.model, data, arm.q);
    Model::MatrixXs placements(3, 4 * arm.model.nv);
    for (int i = 0; i < arm.model.nv; ++i) {
      placements.middleCols<3>(4 * i) = data.oMi[i + 1].rotation();
      placements.col(4 * i + 3) = data.oMi[i + 1].translation();
    }
    out["placements"] = arm.function("placements", {q}, {"q"}, to_sx(placements), "placements");
  }
}

}  // namespace armdyn
