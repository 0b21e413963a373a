// Numeric dynamics of a tree by Pinocchio's algorithms, with the friction of the joints.
#pragma once

#include "tree.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace armdyn {

// Friction torque damping v + coulomb tanh(v / width), per joint; empty: none.
struct Friction {
  std::vector<double> damping, coulomb, width;
};

// For one thread, because of its workspace. Vectors have shape (nv,), matrices (nv, nv), by rows.
class Arm {
 public:
  Arm(const Tree& tree, Friction friction);
  ~Arm();
  Arm(const Arm&) = delete;
  Arm& operator=(const Arm&) = delete;

  std::size_t nv() const { return nv_; }

  // Forward dynamics: the articulated-body algorithm.
  void acceleration(const double* q, const double* v, const double* tau, double* a);
  // Inverse dynamics: recursive Newton-Euler.
  void torque(const double* q, const double* v, const double* a, double* tau);
  // Joint-space inertia M(q): composite rigid bodies.
  void inertia(const double* q, double* matrix);
  // Acceleration and its derivatives with respect to q, v and tau; the last is the inverse of M.
  // J. Carpentier, N. Mansard, Analytical Derivatives of Rigid Body Dynamics Algorithms, RSS 2018.
  void derivatives(const double* q, const double* v, const double* tau, double* a, double* by_q, double* by_v,
                   double* by_tau);

 private:
  void lose(const double* v, double sign, const double* tau);  // free_ = tau + sign friction(v)

  struct Model;
  std::unique_ptr<Model> model_;
  Friction friction_;
  std::size_t nv_;
  std::vector<double> free_;
};

}  // namespace armdyn
