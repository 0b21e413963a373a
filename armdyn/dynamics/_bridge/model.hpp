// Pinocchio's model of a tree, over any scalar.
#pragma once

#include "tree.hpp"

#include <pinocchio/multibody.hpp>
#include <pinocchio/multibody/joint.hpp>
#include <pinocchio/multibody/visitor.hpp>

#include <string>

namespace armdyn {

// Pinocchio's default collection has 25 joint types, each instantiated by every algorithm: 4 GB and two
// minutes of compiler. In joint coordinates (one number per joint) two types describe every arm, and
// SX folds the constant axis entries 0 and 1, so that nothing is lost against JointModelRZ and similar types.
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

template <typename S>
using ArmModel = pinocchio::ModelTpl<S, 0, ArmJoints>;

// Model of a tree with constant parameters.
template <typename S>
ArmModel<S> model_of(const Tree& t) {
  using Model = ArmModel<S>;
  using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  check(t);
  Model model;
  model.gravity.linear() = Eigen::Vector3d(t.gravity.data()).template cast<S>();
  for (int i = 0; i < static_cast<int>(t.parent.size()); ++i) {
    const double* m = t.placement.data() + 12 * i;
    const RowMatrix3 rotation = Eigen::Map<const RowMatrix3>(m);
    const typename Model::SE3 placement(rotation.cast<S>(), Eigen::Vector3d(m + 9).template cast<S>());
    const Eigen::Matrix<S, 3, 1> axis = Eigen::Vector3d(t.axis.data() + 3 * i).template cast<S>();
    const auto parent = static_cast<pinocchio::JointIndex>(t.parent[i] + 1);
    const std::string name = "j" + std::to_string(i);
    if (t.prismatic[i])
      model.addJoint(parent, typename ArmJoints<S, 0>::JointModelPrismatic(axis), placement, name);
    else
      model.addJoint(parent, typename ArmJoints<S, 0>::JointModelRevolute(axis), placement, name);
    const Eigen::Matrix<S, 10, 1> parameters =
        Eigen::Map<const Eigen::Matrix<double, 10, 1>>(t.inertia.data() + 10 * i).template cast<S>();
    // A massless joint (a wrist's dummy link) has no centre of mass.
    const bool massless = t.inertia[10 * i] == 0.0;
    model.inertias[i + 1] = massless ? Model::Inertia::Zero() : Model::Inertia::FromDynamicParameters(parameters);
    model.armature[i] = t.armature[i];
  }
  return model;
}

}  // namespace armdyn
