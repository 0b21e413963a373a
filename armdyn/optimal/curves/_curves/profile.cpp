#include "profile.hpp"

#include "clones.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {

using Run = Profile::Run;

namespace {

constexpr double kHuge = 1e64;  // pivot that fixes its unknown

inline double dot(const double* a, const double* b, int count) {
  double sum = 0.0;
#pragma omp simd reduction(+ : sum)
  for (int k = 0; k < count; ++k) sum += a[k] * b[k];
  return sum;
}

// By columns; finally `values` has L below the diagonal. Runs of column j: the rows below with an entry in it.
ARMDYN_CLONES void factorised(const long* start, const int* run_start, const Run* runs, int n, double least,
                              double* values, double* diagonal, double* column) {
  for (int j = 0; j < n; ++j) {
    const Run *first = runs + run_start[j], *end = runs + run_start[j + 1];
    const double pivot = values[start[j] + j], divisor = std::abs(pivot) > least ? pivot : kHuge;
    diagonal[j] = divisor;
    for (const Run* run = first; run < end; ++run)
      for (int k = run->begin; k < run->end; ++k) column[k] = values[start[k] + j];
    for (const Run* run = first; run < end; ++run)
      for (int i = run->begin; i < run->end; ++i) {
        double* own = values + start[i];
        const double scaled = column[i] / divisor;
        own[j] = scaled;
        for (const Run* other = first; other <= run; ++other) {
          const int last = std::min(other->end, i + 1);
#pragma omp simd
          for (int k = other->begin; k < last; ++k) own[k] -= scaled * column[k];
        }
      }
  }
}

ARMDYN_CLONES void solved(const int* first, const long* start, int n, const double* values, const double* diagonal,
                          double* b) {
  for (int i = 0; i < n; ++i) b[i] -= dot(values + start[i] + first[i], b + first[i], i - first[i]);
  for (int i = n - 1; i >= 0; --i) b[i] /= diagonal[i];
  for (int i = n - 1; i >= 0; --i) {
    const double* own = values + start[i];
    const double x = b[i];
    for (int j = first[i]; j < i; ++j) b[j] -= own[j] * x;
  }
}

}  // namespace

Profile::Profile(const std::vector<int>& first) : first_(first), start_(first.size()), diagonal_(first.size()) {
  long size = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    start_[i] = size - first[i];
    size += static_cast<long>(i) - first[i] + 1;
  }
  values_.resize(size);
  const int n = static_cast<int>(first.size());
  run_start_.assign(n + 1, 0);
  std::vector<int> above(n, -1), next(n);  // last row above with the column; index of the column's next run
  const auto each = [&](auto&& begin) {
    std::fill(above.begin(), above.end(), -1);
    for (int i = 0; i < n; ++i)
      for (int j = first[i]; j < i; above[j++] = i) begin(j, i, above[j] != i - 1);
  };
  each([&](int j, int, bool begins) { run_start_[j + 1] += begins; });
  for (int j = 0; j < n; ++j) run_start_[j + 1] += next[j] = run_start_[j];
  runs_.resize(run_start_[n]);
  each([&](int j, int i, bool begins) {
    if (begins) runs_[next[j]++].begin = i;
    runs_[next[j] - 1].end = i + 1;
  });
  column_.resize(n);
}

void Profile::times(const double* x, double* out) const {
  for (int i = 0; i < size(); ++i) {
    const double* own = row(i);
    double sum = own[i] * x[i];
    for (int j = first_[i]; j < i; ++j) {
      sum += own[j] * x[j];
      out[j] += own[j] * x[i];
    }
    out[i] = sum;
  }
}

void Profile::factorise(double least) {
  factorised(start_.data(), run_start_.data(), runs_.data(), size(), least, values_.data(), diagonal_.data(),
             column_.data());
}

void Profile::solve(double* b) const {
  solved(first_.data(), start_.data(), size(), values_.data(), diagonal_.data(), b);
}

}  // namespace armdyn
