// The kinematic tree as plain numbers.
#pragma once

#include <vector>

namespace armdyn {

// Moving joints 0..n-1 in Pinocchio's order; every vector has n blocks, by rows.
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

// Throws std::invalid_argument if the vectors do not match each other.
void check(const Tree& tree);

}  // namespace armdyn
