// Implicit collocation steps through segments, with the derivatives of their end states.
#include "motion.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>

namespace armdyn {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

// x'' = f(x, x', tau) at the stages; unknowns: the accelerations there, a (stages, n).
class Collocation {
 public:
  Collocation(Arm& arm, const ImplicitMethod& method)
      : arm_(arm), method_(method), s_(static_cast<Eigen::Index>(method.stages)), n_(static_cast<Eigen::Index>(arm.nv())),
        A_(Eigen::Map<const Matrix>(method.A.data(), s_, s_)), AA_(A_ * A_), bA_(b().transpose() * A_), by_q_(n_, n_),
        by_v_(n_, n_), by_tau_(n_, n_), a_(s_, n_), rates_(s_, n_), system_(s_ * n_, s_ * n_),
        sources_(s_ * n_, 3 * n_), change_(s_ * n_), q_here_(n_), v_here_(n_), tau_(n_), there_(n_), far_(n_, 3 * n_),
        fast_(n_, 3 * n_), lu_(s_ * n_) {}

  // Replaces x by the state after h; returns its derivatives in x (2 n, 2 n) and in a constant torque (2 n, n).
  void step(double h, const Vector& first, const Vector& last, Vector& x, Matrix& transition, Matrix& forced) {
    const Vector q = x.head(n_), v = x.tail(n_);
    linearise(h, first, last, q, v);
    const bool found = solve(h, first, last, q, v);
    differentiate(h, first, last, q, v, transition, forced);
    if (!found) a_.setConstant(std::numeric_limits<double>::quiet_NaN());
    x.head(n_) = q + h * (v + h * (bA_ * a_).transpose());
    x.tail(n_) = v + h * (b().transpose() * a_).transpose();
  }

 private:
  Eigen::Map<const Vector> b() const { return {method_.b.data(), s_}; }

  // Derivatives at the middle of the step, and a linear guess of the accelerations from start and middle.
  void linearise(double h, const Vector& first, const Vector& last, const Vector& q, const Vector& v) {
    Vector start(n_);
    arm_.acceleration(q.data(), v.data(), first.data(), start.data());
    const Vector q_there = q + h / 2 * v, v_there = v + h / 2 * start, tau = (first + last) / 2;
    arm_.derivatives(q_there.data(), v_there.data(), tau.data(), there_.data(), by_q_.data(), by_v_.data(),
                     by_tau_.data());
    for (Eigen::Index i = 0; i < s_; ++i) {
      a_.row(i) = (start + 2 * method_.c[i] * (there_ - start)).transpose();
      for (Eigen::Index j = 0; j < s_; ++j)
        system_.block(i * n_, j * n_, n_, n_) = -h * A_(i, j) * by_v_ - h * h * AA_(i, j) * by_q_;
    }
    system_.diagonal().array() += 1.0;
    lu_.compute(system_);
  }

  // State and torque at a stage.
  void place(Eigen::Index i, double h, const Vector& first, const Vector& last, const Vector& q, const Vector& v) {
    q_here_ = q + h * method_.c[i] * v + h * h * (AA_.row(i) * a_).transpose();
    v_here_ = v + h * (A_.row(i) * a_).transpose();
    tau_ = first + method_.c[i] * (last - first);
  }

  // Simplified Newton method with one matrix. False: not converged.
  bool solve(double h, const Vector& first, const Vector& last, const Vector& q, const Vector& v) {
    const double scale = 1 + v.cwiseAbs().maxCoeff();
    double before = std::numeric_limits<double>::quiet_NaN(), error = std::numeric_limits<double>::infinity();
    for (int round = 0; round < method_.most; ++round) {
      for (Eigen::Index i = 0; i < s_; ++i) {
        place(i, h, first, last, q, v);
        arm_.acceleration(q_here_.data(), v_here_.data(), tau_.data(), rates_.row(i).data());
      }
      rates_ -= a_;
      change_ = lu_.solve(Eigen::Map<const Vector>(rates_.data(), s_ * n_));
      Eigen::Map<Vector>(a_.data(), s_ * n_) += change_;
      const double size = change_.allFinite() ? h * change_.cwiseAbs().maxCoeff() / scale
                                              : std::numeric_limits<double>::infinity();
      error = size * std::fmin(size / before, 1.0);  // extrapolated at the last rate of convergence
      if (error <= method_.tolerance || (size > before / 2 && size <= method_.stalled)) break;
      before = size;
    }
    return error <= method_.stalled;
  }

  // Derivatives of the stages' accelerations, and of the end state, in the start state and in a constant torque: those
  // of the step's own equations, so that they converge at its order.
  void differentiate(double h, const Vector& first, const Vector& last, const Vector& q, const Vector& v,
                     Matrix& transition, Matrix& forced) {
    for (Eigen::Index i = 0; i < s_; ++i) {
      place(i, h, first, last, q, v);
      arm_.derivatives(q_here_.data(), v_here_.data(), tau_.data(), there_.data(), by_q_.data(), by_v_.data(),
                       by_tau_.data());
      sources_.middleRows(i * n_, n_) << by_q_, by_v_ + h * method_.c[i] * by_q_, by_tau_;
      for (Eigen::Index j = 0; j < s_; ++j)
        system_.block(i * n_, j * n_, n_, n_) = -h * A_(i, j) * by_v_ - h * h * AA_(i, j) * by_q_;
    }
    system_.diagonal().array() += 1.0;
    lu_.compute(system_);
    sources_ = lu_.solve(sources_);
    far_.setZero();
    fast_.setZero();
    for (Eigen::Index i = 0; i < s_; ++i) {
      far_ += h * h * bA_(i) * sources_.middleRows(i * n_, n_);
      fast_ += h * method_.b[i] * sources_.middleRows(i * n_, n_);
    }
    transition << far_.leftCols(2 * n_), fast_.leftCols(2 * n_);
    transition.diagonal().array() += 1.0;
    transition.topRightCorner(n_, n_).diagonal().array() += h;
    forced << far_.rightCols(n_), fast_.rightCols(n_);
  }

  Arm& arm_;
  const ImplicitMethod& method_;
  Eigen::Index s_, n_;
  Matrix A_, AA_;
  Eigen::RowVectorXd bA_;
  Matrix by_q_, by_v_, by_tau_, a_, rates_, system_, sources_;
  Vector change_, q_here_, v_here_, tau_, there_;
  Matrix far_, fast_;
  Eigen::PartialPivLU<Matrix> lu_;
};

}  // namespace

ImplicitSteps implicit_steps(Arm& arm, const ImplicitMethod& method, const std::vector<double>& h,
                             const std::vector<double>& x, const std::vector<double>& tau, int parts) {
  const auto n = static_cast<Eigen::Index>(arm.nv()), count = static_cast<Eigen::Index>(h.size());
  ImplicitSteps out;
  out.end.resize(count * 2 * n);
  out.state_transition.resize(count * 4 * n * n);
  out.forced.resize(count * 2 * n * n);
  Collocation collocation(arm, method);
  Matrix whole(2 * n, 2 * n), pushed(2 * n, n), own(2 * n, 2 * n), forced(2 * n, n);
  for (Eigen::Index k = 0; k < count; ++k) {
    Vector state = Eigen::Map<const Vector>(&x[k * 2 * n], 2 * n);
    const Vector begin = Eigen::Map<const Vector>(&tau[k * 2 * n], n), end = Eigen::Map<const Vector>(&tau[k * 2 * n + n], n);
    for (int part = 0; part < parts; ++part) {
      const Vector first = begin + (end - begin) * part / parts, last = begin + (end - begin) * (part + 1) / parts;
      collocation.step(h[k] / parts, first, last, state, own, forced);
      if (part) {
        whole = own * whole;  // Eigen evaluates the product before the assignment
        pushed = forced + own * pushed;
      } else {
        whole = own;
        pushed = forced;
      }
    }
    Eigen::Map<Vector>(&out.end[k * 2 * n], 2 * n) = state;
    Eigen::Map<Matrix>(&out.state_transition[k * 4 * n * n], 2 * n, 2 * n) = whole;
    Eigen::Map<Matrix>(&out.forced[k * 2 * n * n], 2 * n, n) = pushed;
  }
  return out;
}

}  // namespace armdyn
