// Symmetric matrix in profile storage, from each row's first entry to the diagonal, and its factors L D L'.
// A. Jennings, "A compact storage scheme for the solution of symmetric linear simultaneous equations", The Computer
// Journal 9(3), 1966. Storage and time are small for narrow rows and a few full ones at the end.
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
  double* row(int i) { return values_.data() + start_[i]; }  // address of column 0; valid from first[i] to i
  const double* row(int i) const { return values_.data() + start_[i]; }

  // Replace the matrix by its factors; a pivot below `least` in size is replaced by a huge one.
  void factorise(double least);
  // Replace b by the solution of L D L' x = b.
  void solve(double* b) const;

 private:
  std::vector<int> first_;
  std::vector<long> start_;
  std::vector<int> run_start_;  // of each column
  std::vector<Run> runs_;       // rows below the diagonal with an entry in the column
  std::vector<double> values_, diagonal_, column_;
};

}  // namespace armdyn
