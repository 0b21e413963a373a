#include "tree.hpp"

#include <pinocchio/multibody/visitor.hpp>

#include <stdexcept>

namespace armdyn {
namespace {

using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Vector symbol(const std::string& name, int n) {
  const SX s = SX::sym(name, n);
  Vector x(n);
  for (int i = 0; i < n; ++i) x[i] = s(i);
  return x;
}

void expect(size_t got, size_t want, const char* what) {
  if (got != want)
    throw std::invalid_argument(std::string(what) + ": expected " + std::to_string(want) + " numbers, got " +
                                std::to_string(got));
}

void check(const Tree& t) {
  const size_t n = t.parent.size();
  expect(t.prismatic.size(), n, "prismatic");
  expect(t.axis.size(), 3 * n, "axis");
  expect(t.placement.size(), 12 * n, "placement");
  expect(t.inertia.size(), 10 * n, "inertia");
  expect(t.armature.size(), n, "armature");
  expect(t.gravity.size(), 3, "gravity");
  for (size_t i = 0; i < n; ++i)
    if (t.parent[i] < -1 || t.parent[i] >= static_cast<int>(i))
      throw std::invalid_argument("parent: a joint's parent must come before it");
  if (t.payload_joint < -1 || t.payload_joint >= static_cast<int>(n))
    throw std::invalid_argument("payload_joint: no such joint");
}

}  // namespace

SymbolicArm::SymbolicArm(const Tree& t) {
  check(t);
  const int n = static_cast<int>(t.parent.size());
  model.gravity.linear() = Eigen::Vector3d(t.gravity.data()).cast<SX>();
  for (int i = 0; i < n; ++i) {
    const double* m = t.placement.data() + 12 * i;
    const RowMatrix3 rotation = Eigen::Map<const RowMatrix3>(m);
    const Model::SE3 placement(rotation.cast<SX>(), Eigen::Vector3d(m + 9).cast<SX>());
    const Eigen::Matrix<SX, 3, 1> axis = Eigen::Vector3d(t.axis.data() + 3 * i).cast<SX>();
    const auto parent = static_cast<pinocchio::JointIndex>(t.parent[i] + 1);
    const std::string name = "j" + std::to_string(i);
    if (t.prismatic[i])
      model.addJoint(parent, ArmJoints<SX, 0>::JointModelPrismatic(axis), placement, name);
    else
      model.addJoint(parent, ArmJoints<SX, 0>::JointModelRevolute(axis), placement, name);

    Eigen::Matrix<SX, 10, 1> inertia =
        Eigen::Map<const Eigen::Matrix<double, 10, 1>>(t.inertia.data() + 10 * i).cast<SX>();
    if (i == t.payload_joint) {
      const SX p = SX::sym("payload", 10);
      for (int k = 0; k < 10; ++k) inertia[k] += p(k);
      payload = {p};
      payload_name = {"payload"};
    }
    // A massless joint (a wrist's dummy link) has no centre of mass to divide by.
    const bool massless = i != t.payload_joint && t.inertia[10 * i] == 0.0;
    model.inertias[i + 1] = massless ? Model::Inertia::Zero() : Model::Inertia::FromDynamicParameters(inertia);
    model.armature[i] = t.armature[i];
  }
  q = symbol("q", n);
  v = symbol("v", n);
  tau = symbol("tau", n);
  a = symbol("a", n);
}

SX to_sx(const Vector& x) {
  SX s(casadi::Sparsity::dense(x.size(), 1));
  for (Eigen::Index i = 0; i < x.size(); ++i) s(i) = x[i];
  return s;
}

SX to_sx(const Model::MatrixXs& x) {
  SX s(casadi::Sparsity::dense(x.rows(), x.cols()));
  for (Eigen::Index i = 0; i < x.rows(); ++i)
    for (Eigen::Index j = 0; j < x.cols(); ++j) s(i, j) = x(i, j);
  return s;
}

std::string SymbolicArm::function(const std::string& name, std::vector<SX> in, std::vector<std::string> in_names,
                                  const SX& out, const std::string& out_name) const {
  in.insert(in.end(), payload.begin(), payload.end());
  in_names.insert(in_names.end(), payload_name.begin(), payload_name.end());
  return casadi::Function(name, in, {out}, in_names, {out_name}).serialize();
}

}  // namespace armdyn
