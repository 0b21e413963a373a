// Rows of a quadratic program in dense blocks: rows that share a slack are in one block.
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
// negative, such as the two sides of a limit, share one base.
struct Block {
  int slack = -1;
  int first_row = 0, rows = 0, bases = 0, columns = 0, width = 0;
  long values = 0, column = 0;  // first indices
};

class BlockRows {
 public:
  // Args: slack of each row, or -1; whether a row is left out; the columns' places, -1 for a fixed column.
  BlockRows(const SparseRows& given, const std::vector<int>& slack, const std::vector<char>& kept,
            const int* place);

  int size() const { return static_cast<int>(order.size()); }
  // out = A x, and out += A' y.
  void times(const double* x, double* out) const;
  void transposed(const double* y, double* out) const;
  // matrix += A' W A, where the rows of a slack are coupled through it: W = diag(w) - w w' / (slack + sum w).
  void add_to(Profile& matrix, const double* weight, const double* of_slack);
  // Raise each column's value to its largest entry.
  void largest(double* out) const;
  // Lower each row's first column to the first one filled by `add_to`.
  void widen(std::vector<int>& first) const;

  std::vector<int> order;  // index of each row in the program

 private:
  std::vector<Block> blocks_;
  std::vector<double> values_;
  std::vector<int> columns_;
  std::vector<int> base_;     // base of each row in its block
  std::vector<double> sign_;  // sign of each row relative to its base
  mutable std::vector<double> work_, of_bases_;
};

}  // namespace armdyn
