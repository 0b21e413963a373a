// The kinematic tree as plain numbers, and Pinocchio's model of it with CasADi's SX as the scalar.
#pragma once

#include <pinocchio/autodiff/casadi.hpp>

#include <pinocchio/multibody.hpp>
#include <pinocchio/multibody/joint.hpp>

#include <map>
#include <string>
#include <vector>

namespace armdyn {

// Pinocchio's default collection has 25 joint types, each instantiated by every algorithm: 4 GB and two
// minutes of compiler. In joint coordinates (one number per joint) two types describe every arm, and
// SX folds the constant axis entries 0 and 1, so nothing is lost against JointModelRZ and its like.
template <typename S, int O>
struct ArmJoints {
  using Scalar = S;
  static constexpr int Options = O;
  using JointModelRevolute = pinocchio::JointModelRevoluteUnalignedTpl<S, O>;
  using JointModelPrismatic = pinocchio::JointModelPrismaticUnalignedTpl<S, O>;
  using JointDataRevolute = pinocchio::JointDataRevoluteUnalignedTpl<S, O>;
  using JointDataPrismatic = pinocchio::JointDataPrismaticUnalignedTpl<S, O>;
  using JointModelVariant = boost::variant<JointModelRevolute, JointModelPrismatic>;
  using JointDataVariant = boost::variant<JointDataRevolute, JointDataPrismatic>;
};

using SX = casadi::SX;
using Model = pinocchio::ModelTpl<SX, 0, ArmJoints>;
using Data = Model::Data;
using Vector = Model::VectorXs;
using Functions = std::map<std::string, std::string>;

// Moving joints 0..n-1 in Pinocchio's order; every vector holds n blocks, row after row.
struct Tree {
  std::vector<int> parent;         // -1: the base
  std::vector<bool> prismatic;     // else revolute
  std::vector<double> axis;        // 3 n, unit, in the joint frame
  std::vector<double> placement;   // 12 n: rotation (row-major), translation [m], in the parent joint
  std::vector<double> inertia;     // 10 n: Pinocchio's dynamic parameters m, m c, I about the joint origin
  std::vector<double> armature;    // n: reflected rotor inertia [kg m^2] or [kg]
  std::vector<double> gravity;     // 3: [m/s^2]
  int payload_joint = -1;          // >= 0: every Function gets one more input, ten dynamic parameters
};

// A model whose numbers are constants but, with a payload joint, the inertia of that joint.
struct SymbolicArm {
  explicit SymbolicArm(const Tree& tree);

  Model model;
  Vector q, v, tau, a;
  std::vector<SX> payload;                 // empty, or the one extra input
  std::vector<std::string> payload_name;

  // Serialized Function of the named inputs, the payload last.
  std::string function(const std::string& name, std::vector<SX> in, std::vector<std::string> in_names,
                       const SX& out, const std::string& out_name) const;
};

SX to_sx(const Vector& x);
SX to_sx(const Model::MatrixXs& x);

// One translation unit each, so that two cores share the work.
void add_forward_dynamics(const SymbolicArm& arm, Functions& out);
void add_inverse_dynamics(const SymbolicArm& arm, Functions& out);
void add_inertia_and_energy(const SymbolicArm& arm, Functions& out);

}  // namespace armdyn
