#include "rows.hpp"

#include "clones.hpp"

#include <algorithm>
#include <cstring>

namespace armdyn {
namespace {

// Rows b_k and weights w_k with sum of w_k b_k b_k' = A' (diag(w) - w w' / (s + sum w)) A, without a difference of
// large numbers: the update of a weighted variance, B. P. Welford, Technometrics 4(3), 1962.
ARMDYN_CLONES void weighted(const double* values, int rows, int columns, const double* weight, double slack,
                            double* centred, double* scaled, double* lower) {
  double* mean = lower;  // not in use yet
  std::fill(mean, mean + columns, 0.0);
  double sum = slack;
  for (int k = 0; k < rows; ++k) {
    const double* own = values + k * columns;
    double *b = centred + k * columns, *wb = scaled + k * columns;
    const bool shared = slack >= 0;
    const double total = sum + weight[k], w = shared ? (total > 0 ? sum * (weight[k] / total) : 0.0) : weight[k];
    const double moved = shared && total > 0 ? weight[k] / total : 0.0;
    for (int i = 0; i < columns; ++i) {
      b[i] = own[i] - mean[i];
      wb[i] = w * b[i];
      mean[i] += moved * b[i];
    }
    sum = total;
  }
  for (int i = 0; i < columns; ++i) {
    double* out = lower + i * columns;
    for (int j = 0; j <= i; ++j) out[j] = 0.0;
    for (int k = 0; k < rows; ++k) {
      const double factor = scaled[k * columns + i];
      const double* b = centred + k * columns;
      for (int j = 0; j <= i; ++j) out[j] += factor * b[j];
    }
  }
}

ARMDYN_CLONES void product(const double* values, int rows, int columns, const double* x, double* out) {
  for (int k = 0; k < rows; ++k) {
    const double* own = values + k * columns;
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < columns; ++i) sum += own[i] * x[i];
    out[k] = sum;
  }
}

ARMDYN_CLONES void product_transposed(const double* values, int rows, int columns, const double* y, double* out) {
  std::fill(out, out + columns, 0.0);
  for (int k = 0; k < rows; ++k) {
    const double* own = values + k * columns;
    for (int i = 0; i < columns; ++i) out[i] += y[k] * own[i];
  }
}

}  // namespace

BlockRows::BlockRows(const SparseRows& given, const std::vector<int>& slack, const std::vector<char>& kept,
                     const int* place) {
  for (int i = 0; i < given.rows; ++i)
    if (kept[i]) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return slack[a] < slack[b]; });
  std::vector<int> at;  // of each column in the block, + 1
  int most = 0;
  for (int first = 0, last = 0; first < size(); first = last) {
    const int own = slack[order[first]];
    for (last = first + 1; own >= 0 && last < size() && slack[order[last]] == own;) ++last;
    Block block{own, first, last - first, 0, static_cast<long>(values_.size()), static_cast<long>(columns_.size())};
    for (int k = first; k < last; ++k)
      for (int e = given.start[order[k]]; e < given.start[order[k] + 1]; ++e)
        if (place[given.column[e]] >= 0) columns_.push_back(place[given.column[e]]);
    std::sort(columns_.begin() + block.column, columns_.end());
    columns_.erase(std::unique(columns_.begin() + block.column, columns_.end()), columns_.end());
    block.columns = static_cast<int>(columns_.size() - block.column);
    values_.resize(values_.size() + static_cast<std::size_t>(block.rows) * block.columns);
    for (int i = 0; i < block.columns; ++i) {
      const int column = columns_[block.column + i];
      if (column >= static_cast<int>(at.size())) at.resize(column + 1);
      at[column] = i;
    }
    for (int k = first; k < last; ++k)
      for (int e = given.start[order[k]]; e < given.start[order[k] + 1]; ++e)
        if (const int column = place[given.column[e]]; column >= 0)
          values_[block.values + static_cast<long>(k - first) * block.columns + at[column]] += given.value[e];
    most = std::max({most, block.rows, block.columns});
    blocks_.push_back(block);
  }
  work_.resize(3 * static_cast<std::size_t>(most) * std::max(most, 1));
}

void BlockRows::widen(std::vector<int>& first) const {
  for (const Block& block : blocks_) {
    if (!block.columns) continue;
    const int* column = columns_.data() + block.column;
    for (int i = 0; i < block.columns; ++i) first[column[i]] = std::min(first[column[i]], column[0]);
  }
}

void BlockRows::times(const double* x, double* out) const {
  double* local = work_.data();
  for (const Block& block : blocks_) {
    for (int i = 0; i < block.columns; ++i) local[i] = x[columns_[block.column + i]];
    product(values_.data() + block.values, block.rows, block.columns, local, out + block.first_row);
  }
}

void BlockRows::transposed(const double* y, double* out) const {
  double* local = work_.data();
  for (const Block& block : blocks_) {
    product_transposed(values_.data() + block.values, block.rows, block.columns, y + block.first_row, local);
    for (int i = 0; i < block.columns; ++i) out[columns_[block.column + i]] += local[i];
  }
}

void BlockRows::add_to(Profile& matrix, const double* weight, const double* of_slack) {
  const std::size_t third = work_.size() / 3;
  double *centred = work_.data(), *scaled = centred + third, *lower = scaled + third;
  for (const Block& block : blocks_) {
    const int n = block.columns;
    weighted(values_.data() + block.values, block.rows, n, weight + block.first_row,
             block.slack < 0 ? -1.0 : of_slack[block.slack], centred, scaled, lower);
    const int* column = columns_.data() + block.column;
    for (int i = 0; i < n; ++i) {
      double* row = matrix.row(column[i]);
      for (int j = 0; j <= i; ++j) row[column[j]] += lower[i * n + j];
    }
  }
}

}  // namespace armdyn
