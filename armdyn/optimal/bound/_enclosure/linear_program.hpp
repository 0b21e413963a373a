// A linear program in boxes whose columns touch few rows that stand near each other, or at the end.
//
//   minimise cost . x   subject to   A x = right,  lower <= x <= upper
#pragma once

#include <vector>

namespace armdyn {

struct LinearProgram {
  int rows = 0, columns = 0;
  const int* start = nullptr;  // entries of column j are start[j] .. start[j + 1], their rows increasing
  const int* row = nullptr;
  const double* value = nullptr;
  const double* right = nullptr;
  const double* cost = nullptr;
  const double* lower = nullptr;  // finite
  const double* upper = nullptr;
  double tolerance = 1e-8;  // of the cost, relative to 1 and to its size
  int most = 60;            // iterations
};

struct LinearSolution {
  bool found = false;
  int iterations = 0;
  double cost = 0.0;                // that no x undercuts, by the multipliers
  std::vector<double> multipliers;  // of the rows: d cost / d right
};

LinearSolution solve(const LinearProgram& program);

}  // namespace armdyn
