// Rows of a quadratic program, gathered into dense blocks: rows that share a slack stand together.
#pragma once

#include "profile.hpp"

#include <vector>

namespace armdyn {

// Compressed rows: entries of row i are start[i] .. start[i + 1].
struct SparseRows {
  int rows = 0;
  const int* start = nullptr;
  const int* column = nullptr;
  const double* value = nullptr;
};

// Rows on the same columns; those that share a slack have its index, others -1. `values` is bases x width: a row and its
// negative, as the two sides of a limit are, have one base.
struct Block {
  int slack = -1;
  int first_row = 0, rows = 0, bases = 0, columns = 0, width = 0;
  long values = 0, column = 0;  // where they begin
};

class BlockRows {
 public:
  // Args: slack of each row, or -1; which rows are left out; the columns' places, or -1 of a column that is fixed.
  BlockRows(const SparseRows& given, const std::vector<int>& slack, const std::vector<char>& kept,
            const int* place);

  int size() const { return static_cast<int>(order.size()); }
  // out = A x, and out += A' y.
  void times(const double* x, double* out) const;
  void transposed(const double* y, double* out) const;
  // matrix += A' W A, where the rows of a slack share `weight` through it: W = diag(w) - w w' / (slack + sum w).
  void add_to(Profile& matrix, const double* weight, const double* of_slack);
  // Raise each column's number to its largest entry.
  void largest(double* out) const;
  // Lower each row's first column to what `add_to` fills.
  void widen(std::vector<int>& first) const;

  std::vector<int> order;  // row of the program that each row is

 private:
  std::vector<Block> blocks_;
  std::vector<double> values_;
  std::vector<int> columns_;
  std::vector<int> base_;     // of each row, in its block
  std::vector<double> sign_;  // of each row, times its base
  mutable std::vector<double> work_, of_bases_;
};

}  // namespace armdyn
