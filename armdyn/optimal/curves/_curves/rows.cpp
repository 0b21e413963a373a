#include "rows.hpp"

#include "clones.hpp"

#include <algorithm>
#include <cmath>

namespace armdyn {
namespace {

constexpr int kTile = 8;  // columns of a block are padded to a multiple of this

typedef double Lane __attribute__((vector_size(kTile * sizeof(double)), aligned(sizeof(double)), may_alias));

inline int padded(int columns) { return (columns + kTile - 1) / kTile * kTile; }

// lower = sum over k of scaled_k centred_k', its tiles on and below the diagonal; all have rows of `width` numbers.
inline __attribute__((always_inline)) void products(const double* centred, const double* scaled, int rows, int width,
                                                    double* lower) {
  for (int i = 0; i < width; i += kTile)
    for (int j = 0; j <= i; j += kTile) {
      Lane sum[kTile] = {};
      for (int k = 0; k < rows; ++k) {
        const double* left = scaled + k * width + i;
        const Lane right = *reinterpret_cast<const Lane*>(centred + k * width + j);
        for (int a = 0; a < kTile; ++a) sum[a] += left[a] * right;
      }
      for (int a = 0; a < kTile; ++a) *reinterpret_cast<Lane*>(lower + (i + a) * width + j) = sum[a];
    }
}

// lower = A' diag(w) A, or with a slack A' (diag(w) - w w' / (slack + sum w)) A, without a difference of large numbers:
// the update of a weighted variance, B. P. Welford, Technometrics 4(3), 1962.
ARMDYN_CLONES void weighted(const double* values, int rows, int width, const double* weight, double slack,
                            double* centred, double* scaled, double* lower) {
  if (slack < 0) {
    for (int k = 0; k < rows; ++k)
      for (int i = 0; i < width; ++i) scaled[k * width + i] = weight[k] * values[k * width + i];
    products(values, scaled, rows, width, lower);
    return;
  }
  double *mean = lower, sum = slack;  // unused so far
  for (int i = 0; i < width; ++i) mean[i] = 0.0;
  for (int k = 0; k < rows; ++k) {
    const double* own = values + k * width;
    double *b = centred + k * width, *wb = scaled + k * width;
    const double total = sum + weight[k], moved = total > 0 ? weight[k] / total : 0.0, w = sum * moved;
    for (int i = 0; i < width; ++i) {
      b[i] = own[i] - mean[i];
      wb[i] = w * b[i];
      mean[i] += moved * b[i];
    }
    sum = total;
  }
  products(centred, scaled, rows, width, lower);
}

// The same, with base k weighted by up, and its negative by down; `scaled` is W A.
ARMDYN_CLONES void weighted_pairs(const double* values, int bases, int width, const double* up, const double* down,
                                  double slack, double* scaled, double* lower) {
  double total = slack;
  for (int k = 0; k < bases; ++k) total += up[k] + down[k];
  for (int k = 0; k < bases; ++k) {
    double* own = scaled + k * width;
    double others = slack;
    for (int i = 0; i < width; ++i) own[i] = 0.0;
    for (int j = 0; j < bases; ++j) {
      if (j == k) continue;
      others += up[j] + down[j];
      const double factor = total > 0 ? (up[k] - down[k]) / total * (up[j] - down[j]) : 0.0;
      for (int i = 0; i < width; ++i) own[i] -= factor * values[j * width + i];
    }
    const double diagonal = total > 0 ? (up[k] + down[k]) / total * others + 4 * up[k] / total * down[k] : 0.0;
    for (int i = 0; i < width; ++i) own[i] += diagonal * values[k * width + i];
  }
  products(values, scaled, bases, width, lower);
}

ARMDYN_CLONES void product(const double* values, int rows, int width, const double* x, double* out) {
  for (int k = 0; k < rows; ++k) {
    const double* own = values + k * width;
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < width; ++i) sum += own[i] * x[i];
    out[k] = sum;
  }
}

ARMDYN_CLONES void product_transposed(const double* values, int rows, int width, const double* y, double* out) {
  for (int i = 0; i < width; ++i) out[i] = 0.0;
  for (int k = 0; k < rows; ++k) {
    const double* own = values + k * width;
    for (int i = 0; i < width; ++i) out[i] += y[k] * own[i];
  }
}

// Order of two rows by their columns: -1, 0 (equal), 1.
int compared(const SparseRows& given, int a, int b) {
  const int *first = given.column + given.start[a], *end = given.column + given.start[a + 1];
  const int *other = given.column + given.start[b], *last = given.column + given.start[b + 1];
  for (; first < end && other < last; ++first, ++other)
    if (*first != *other) return *first < *other ? -1 : 1;
  return first < end ? 1 : other < last ? -1 : 0;
}

// Whether one row is the other's negative.
bool opposed(const SparseRows& given, int a, int b) {
  const double* value = given.value;
  return std::equal(value + given.start[a], value + given.start[a + 1], value + given.start[b],
                    value + given.start[b + 1], [](double x, double y) { return x == -y; }) &&
         compared(given, a, b) == 0;
}

}  // namespace

BlockRows::BlockRows(const SparseRows& given, const std::vector<int>& slack, const std::vector<char>& kept,
                     const int* place) {
  for (int i = 0; i < given.rows; ++i)
    if (kept[i]) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return slack[a] != slack[b] ? slack[a] < slack[b] : slack[a] < 0 && compared(given, a, b) < 0;
  });
  base_.resize(order.size());
  sign_.assign(order.size(), 1.0);
  std::vector<int> bases;  // bases of a block, as rows of the program
  std::vector<int> at;  // index of each column in the block, + 1
  int most = 0;
  for (int first = 0, last = 0; first < size(); first = last) {
    const int own = slack[order[first]];
    const auto together = [&](int k) { return slack[order[k]] == own && (own >= 0 || compared(given, order[first], order[k]) == 0); };
    for (last = first + 1; last < size() && together(last);) ++last;
    Block block{own, first, last - first, 0, 0, 0, static_cast<long>(values_.size()), static_cast<long>(columns_.size())};
    bases.clear();
    for (int k = first, next = 0; k < last; ++k) {  // negatives are in the order of their bases, some are left out
      int base = next;
      while (base < static_cast<int>(bases.size()) && !opposed(given, bases[base], order[k])) ++base;
      if (base < static_cast<int>(bases.size())) {
        sign_[k] = -1.0;
        next = base + 1;
      } else {
        bases.push_back(order[k]);
      }
      base_[k] = base;
    }
    block.bases = static_cast<int>(bases.size());
    for (int k = first; k < last; ++k) {
      if (k > first && compared(given, order[k - 1], order[k]) == 0) continue;
      for (int e = given.start[order[k]]; e < given.start[order[k] + 1]; ++e)
        if (place[given.column[e]] >= 0) columns_.push_back(place[given.column[e]]);
    }
    std::sort(columns_.begin() + block.column, columns_.end());
    columns_.erase(std::unique(columns_.begin() + block.column, columns_.end()), columns_.end());
    block.columns = static_cast<int>(columns_.size() - block.column);
    block.width = padded(block.columns);
    values_.resize(values_.size() + static_cast<std::size_t>(block.bases) * block.width);
    for (int i = 0; i < block.columns; ++i) {
      const int column = columns_[block.column + i];
      if (column >= static_cast<int>(at.size())) at.resize(column + 1);
      at[column] = i;
    }
    for (int k = 0; k < block.bases; ++k)
      for (int e = given.start[bases[k]]; e < given.start[bases[k] + 1]; ++e)
        if (const int column = place[given.column[e]]; column >= 0)
          values_[block.values + static_cast<long>(k) * block.width + at[column]] += given.value[e];
    most = std::max({most, block.rows, block.width});
    blocks_.push_back(block);
  }
  work_.resize(3 * static_cast<std::size_t>(most) * std::max(most, 1));
  of_bases_.resize(2 * static_cast<std::size_t>(most));
}

void BlockRows::widen(std::vector<int>& first) const {
  for (const Block& block : blocks_) {
    if (!block.columns) continue;
    const int* column = columns_.data() + block.column;
    for (int i = 0; i < block.columns; ++i) first[column[i]] = std::min(first[column[i]], column[0]);
  }
}

void BlockRows::largest(double* out) const {
  for (const Block& block : blocks_)
    for (int k = 0; k < block.bases; ++k)
      for (int i = 0; i < block.columns; ++i) {
        double& own = out[columns_[block.column + i]];
        own = std::max(own, std::abs(values_[block.values + static_cast<long>(k) * block.width + i]));
      }
}

void BlockRows::times(const double* x, double* out) const {
  double* local = work_.data();
  for (const Block& block : blocks_) {
    for (int i = 0; i < block.columns; ++i) local[i] = x[columns_[block.column + i]];
    for (int i = block.columns; i < block.width; ++i) local[i] = 0.0;
    product(values_.data() + block.values, block.bases, block.width, local, of_bases_.data());
    for (int k = block.first_row; k < block.first_row + block.rows; ++k) out[k] = sign_[k] * of_bases_[base_[k]];
  }
}

void BlockRows::transposed(const double* y, double* out) const {
  double* local = work_.data();
  for (const Block& block : blocks_) {
    std::fill_n(of_bases_.begin(), block.bases, 0.0);
    for (int k = block.first_row; k < block.first_row + block.rows; ++k) of_bases_[base_[k]] += sign_[k] * y[k];
    product_transposed(values_.data() + block.values, block.bases, block.width, of_bases_.data(), local);
    for (int i = 0; i < block.columns; ++i) out[columns_[block.column + i]] += local[i];
  }
}

void BlockRows::add_to(Profile& matrix, const double* weight, const double* of_slack) {
  const std::size_t third = work_.size() / 3;
  double *centred = work_.data(), *scaled = centred + third, *lower = scaled + third;
  for (const Block& block : blocks_) {
    const double* values = values_.data() + block.values;
    double *up = of_bases_.data(), *down = up + block.bases;
    std::fill_n(up, 2 * block.bases, 0.0);
    for (int k = block.first_row; k < block.first_row + block.rows; ++k) (sign_[k] > 0 ? up : down)[base_[k]] += weight[k];
    if (block.slack >= 0 && block.bases < block.rows) {
      weighted_pairs(values, block.bases, block.width, up, down, of_slack[block.slack], scaled, lower);
    } else {
      for (int k = 0; k < block.bases; ++k) up[k] += down[k];
      weighted(values, block.bases, block.width, up, block.slack < 0 ? -1.0 : of_slack[block.slack], centred, scaled, lower);
    }
    const int* column = columns_.data() + block.column;
    for (int i = 0; i < block.columns; ++i) {
      double* row = matrix.row(column[i]);
      for (int j = 0; j <= i; ++j) row[column[j]] += lower[i * block.width + j];
    }
  }
}

}  // namespace armdyn
