// A symmetric matrix stored from each row's first entry to its diagonal, and its factors L D L'.
// A. Jennings, "A compact storage scheme for the solution of symmetric linear simultaneous equations", The Computer
// Journal 9(3), 1966. Rows without entries far from the diagonal, and a few full ones at the end, cost what they hold.
#pragma once

#include <algorithm>
#include <vector>

namespace armdyn {

class Profile {
 public:
  struct Run {
    int begin, end;  // rows
  };

  // first: column of each row's first entry.
  explicit Profile(const std::vector<int>& first);

  int size() const { return static_cast<int>(first_.size()); }
  // out = M x.
  void times(const double* x, double* out) const;
  void clear() { std::fill(values_.begin(), values_.end(), 0.0); }
  double* row(int i) { return values_.data() + start_[i]; }  // of column 0; valid from first[i] to i
  const double* row(int i) const { return values_.data() + start_[i]; }

  // Replace the matrix by its factors; a pivot below `least` in size is replaced by a huge one.
  void factorise(double least);
  // Replace b by the solution of L D L' x = b.
  void solve(double* b) const;

 private:
  std::vector<int> first_;
  std::vector<long> start_;
  std::vector<int> run_start_;  // of each column
  std::vector<Run> runs_;       // rows below the diagonal that hold the column
  std::vector<double> values_, diagonal_, column_;
};

}  // namespace armdyn
