// Linear program in boxes. Each column has few nonzero rows, near each other or at the end.
//
//   minimise cost . x   subject to   A x = right,  lower <= x <= upper
#pragma once

#include <vector>

namespace armdyn {

struct LinearProgram {
  int rows = 0, columns = 0;
  const int* start = nullptr;  // entries of column j are start[j] .. start[j + 1], with increasing rows
  const int* row = nullptr;
  const double* value = nullptr;
  const double* right = nullptr;
  const double* cost = nullptr;
  const double* lower = nullptr;  // finite
  const double* upper = nullptr;
  double tolerance = 1e-8;  // of the cost, relative to 1 and to its size
  int most = 60;            // iteration limit
};

struct LinearSolution {
  bool found = false;
  int iterations = 0;
  double cost = 0.0;                // dual bound of the cost
  std::vector<double> multipliers;  // of the rows: d cost / d right
};

LinearSolution solve(const LinearProgram& program);

}  // namespace armdyn
