#include "arm.hpp"

#include "model.hpp"

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace armdyn {

using In = Eigen::Map<const Eigen::VectorXd>;
using Out = Eigen::Map<Eigen::VectorXd>;
using Rows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

struct Arm::Model {
  explicit Model(const Tree& tree) : model(model_of<double>(tree)), data(model) {}
  ArmModel<double> model;
  ArmModel<double>::Data data;
};

Arm::Arm(const Tree& tree, Friction friction)
    : model_(std::make_unique<Model>(tree)), friction_(std::move(friction)), nv_(tree.parent.size()), free_(nv_) {
  for (const auto* each : {&friction_.damping, &friction_.coulomb, &friction_.width})
    if (each->size() != friction_.damping.size() || (!each->empty() && each->size() != nv_))
      throw std::invalid_argument("friction: one number per joint, or none");
}

Arm::~Arm() = default;

void Arm::lose(const double* v, double sign, const double* tau) {
  for (std::size_t i = 0; i < nv_; ++i) {
    free_[i] = tau[i];
    if (!friction_.damping.empty())
      free_[i] += sign * (friction_.damping[i] * v[i] + friction_.coulomb[i] * std::tanh(v[i] / friction_.width[i]));
  }
}

void Arm::acceleration(const double* q, const double* v, const double* tau, double* a) {
  const auto n = static_cast<Eigen::Index>(nv_);
  lose(v, -1, tau);
  Out(a, n) = pinocchio::aba(model_->model, model_->data, In(q, n), In(v, n), In(free_.data(), n),
                             pinocchio::Convention::LOCAL);
}

void Arm::torque(const double* q, const double* v, const double* a, double* tau) {
  const auto n = static_cast<Eigen::Index>(nv_);
  lose(v, 1, pinocchio::rnea(model_->model, model_->data, In(q, n), In(v, n), In(a, n)).data());
  std::copy(free_.begin(), free_.end(), tau);
}

void Arm::inertia(const double* q, double* matrix) {
  const auto n = static_cast<Eigen::Index>(nv_);
  auto& data = model_->data;
  pinocchio::crba(model_->model, data, In(q, n), pinocchio::Convention::LOCAL);  // the upper triangle
  data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose().triangularView<Eigen::StrictlyLower>();
  Rows(matrix, n, n) = data.M;
}

void Arm::derivatives(const double* q, const double* v, const double* tau, double* a, double* by_q, double* by_v,
                      double* by_tau) {
  const auto n = static_cast<Eigen::Index>(nv_);
  auto& data = model_->data;
  lose(v, -1, tau);
  pinocchio::computeABADerivatives(model_->model, data, In(q, n), In(v, n), In(free_.data(), n));
  auto& inverse = data.Minv;
  inverse.triangularView<Eigen::StrictlyLower>() = inverse.transpose().triangularView<Eigen::StrictlyLower>();
  Out(a, n) = data.ddq;
  Rows(by_q, n, n) = data.ddq_dq;
  Rows(by_v, n, n) = data.ddq_dv;
  Rows(by_tau, n, n) = inverse;
  if (friction_.damping.empty()) return;
  for (Eigen::Index j = 0; j < n; ++j) {
    const double turn = std::tanh(v[j] / friction_.width[j]);
    const double slope = friction_.damping[j] + friction_.coulomb[j] / friction_.width[j] * (1 - turn * turn);
    Rows(by_v, n, n).col(j) -= slope * inverse.col(j);
  }
}

}  // namespace armdyn
