// Convex quadratic program. Each row has few unknowns, near each other or at the end.
//
//   minimise    gradient . d + d . curvature d / 2 + sum of squares + prices . slacks
//   subject to  lower <= d <= upper,  A d - slack of the row <= top,  slacks >= 0
#pragma once

#include "rows.hpp"

#include <vector>

namespace armdyn {

struct QuadraticProgram {
  int size = 0;
  const int* place = nullptr;  // order of elimination of each unknown; -1: fixed
  const double* gradient = nullptr;
  SparseRows curvature;  // symmetric, both triangles
  SparseRows squares;    // each adds weight (a d)^2 / 2
  const double* square_weight = nullptr;
  const double* lower = nullptr;  // finite, lower < upper where not fixed
  const double* upper = nullptr;
  SparseRows rows;
  const double* top = nullptr;
  const int* slack = nullptr;  // slack of each row; -1: none
  int slacks = 0;
  const double* price = nullptr;  // price of each slack
  double tolerance = 1e-8;
  int most = 100;  // iteration limit
};

struct QuadraticSolution {
  bool found = false;
  int iterations = 0;
  double cost = 0.0;  // including priced slacks
  std::vector<double> step, multipliers, bounds;  // bounds: multipliers of the bounds, positive at the upper one
};

QuadraticSolution solve(const QuadraticProgram& program);

}  // namespace armdyn
