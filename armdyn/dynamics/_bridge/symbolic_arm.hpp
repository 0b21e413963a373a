// Pinocchio's model of a tree with CasADi's SX as the scalar.
#pragma once

#include <pinocchio/autodiff/casadi.hpp>

#include "model.hpp"

#include <map>
#include <string>
#include <vector>

namespace armdyn {

using SX = casadi::SX;
using Model = ArmModel<SX>;
using Data = Model::Data;
using Vector = Model::VectorXs;
using Functions = std::map<std::string, std::string>;

// Model with constant parameters except, with a payload joint, the inertia of that joint.
struct SymbolicArm {
  explicit SymbolicArm(const Tree& tree);

  Model model;
  Vector q, v, tau, a;
  std::vector<SX> payload;                 // empty, or one extra input
  std::vector<std::string> payload_name;

  // Serialized Function of the named inputs, the payload last.
  std::string function(const std::string& name, std::vector<SX> in, std::vector<std::string> in_names,
                       const SX& out, const std::string& out_name) const;
};

SX to_sx(const Vector& x);
SX to_sx(const Model::MatrixXs& x);

// One translation unit each, for parallel compilation.
void add_forward_dynamics(const SymbolicArm& arm, Functions& out);
void add_inverse_dynamics(const SymbolicArm& arm, Functions& out);
void add_inertia_and_energy(const SymbolicArm& arm, Functions& out);

}  // namespace armdyn
