#include "symbolic_arm.hpp"

namespace armdyn {
namespace {

Vector symbol(const std::string& name, int n) {
  const SX s = SX::sym(name, n);
  Vector x(n);
  for (int i = 0; i < n; ++i) x[i] = s(i);
  return x;
}

}  // namespace

SymbolicArm::SymbolicArm(const Tree& t) : model(model_of<SX>(t)) {
  const int n = static_cast<int>(t.parent.size());
  if (t.payload_joint >= 0) {
    const SX p = SX::sym("payload", 10);
    Eigen::Matrix<SX, 10, 1> inertia =
        Eigen::Map<const Eigen::Matrix<double, 10, 1>>(t.inertia.data() + 10 * t.payload_joint).cast<SX>();
    for (int k = 0; k < 10; ++k) inertia[k] += p(k);
    model.inertias[t.payload_joint + 1] = Model::Inertia::FromDynamicParameters(inertia);
    payload = {p};
    payload_name = {"payload"};
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
