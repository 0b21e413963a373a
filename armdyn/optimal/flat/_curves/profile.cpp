#include "profile.hpp"

#include "clones.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {
namespace {

constexpr double kHuge = 1e64;  // a pivot that leaves its unknown where it is

inline double dot(const double* a, const double* b, int count) {
  double sum = 0.0;
#pragma omp simd reduction(+ : sum)
  for (int k = 0; k < count; ++k) sum += a[k] * b[k];
  return sum;
}

// In the end `values` holds L below the diagonal.
ARMDYN_CLONES void factorised(const int* first, const long* start, int n, double least, double* values,
                              double* diagonal) {
  for (int i = 0; i < n; ++i) {
    double* own = values + start[i];
    for (int j = first[i]; j < i; ++j) {
      const int from = std::max(first[i], first[j]);
      own[j] -= dot(own + from, values + start[j] + from, j - from);
    }
    double pivot = own[i];
    for (int j = first[i]; j < i; ++j) {
      const double scaled = own[j];
      own[j] /= diagonal[j];
      pivot -= scaled * own[j];
    }
    diagonal[i] = std::abs(pivot) > least ? pivot : kHuge;
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
}

void Profile::clear() { std::fill(values_.begin(), values_.end(), 0.0); }

void Profile::factorise(double least) {
  factorised(first_.data(), start_.data(), size(), least, values_.data(), diagonal_.data());
}

void Profile::solve(double* b) const {
  solved(first_.data(), start_.data(), size(), values_.data(), diagonal_.data(), b);
}

}  // namespace armdyn
