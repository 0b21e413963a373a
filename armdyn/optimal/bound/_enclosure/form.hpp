// Range of linear' v + Σ squares_ab v_a v_b + Σ_k ε_k (turning_k' v + weight_k) over |ε_k| ≤ 1 and a box of v.
#pragma once

namespace armdyn {

// Table of intervals.
struct Table {
  const double *lower = nullptr, *upper = nullptr;
};

struct Form {
  int boxes = 0, n = 0, many = 0;
  Table v;        // (boxes, n)
  Table linear;   // (boxes, n, many)
  Table squares;  // a ≥ b, row by row (boxes, n (n + 1) / 2, many)
  Table turning;  // indexed by k, then by v (boxes, n, n, many); null: zero
  Table weight;   // (boxes, n, many)
  bool corners = true;  // whether all corners of the box of v are evaluated; else products by magnitude
};

// lower, upper: (boxes, many).
void range_of(const Form& form, double* lower, double* upper);

}  // namespace armdyn
