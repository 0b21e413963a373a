// Vectors of boxes (lanes), and directed rounding.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <new>

namespace armdyn {

constexpr int kLanes = 4;
typedef double Lanes __attribute__((vector_size(8 * kLanes)));
typedef long long Bits __attribute__((vector_size(8 * kLanes)));

// One binary for all x86-64 with bitwise equal results: lanes do not mix, and no operations are contracted.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define ARMDYN_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define ARMDYN_CLONES
#endif
#define ARMDYN_INLINE static inline __attribute__((always_inline))

// Zeros, aligned for the newest instructions, which std::vector does not guarantee.
class Memory {
 public:
  explicit Memory(std::size_t count) {
    const std::size_t size = (count * sizeof(Lanes) / 64 + 1) * 64;
    values_ = static_cast<Lanes*>(std::aligned_alloc(64, size));
    if (!values_) throw std::bad_alloc();
    std::memset(static_cast<void*>(values_), 0, size);
  }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;
  ~Memory() { std::free(values_); }
  Lanes* data() { return values_; }
  Lanes& operator[](std::size_t i) { return values_[i]; }

 private:
  Lanes* values_;
};

constexpr double kUnit = 1.0 / 9007199254740992.0;  // unit roundoff u = 2^-53
constexpr double kTiny = 1e-300;                    // bound on underflow in sums
constexpr double kLibrary = 1e-15;  // error of the library's sine and cosine: 9 ulp of 1; vendors state 4
constexpr double kNear = 1e-12;     // distance in half periods at which an extremum counts as inside

ARMDYN_INLINE Lanes all(double x) { return Lanes{} + x; }
ARMDYN_INLINE Lanes magnitude(Lanes x) { return (Lanes)((Bits)x & 0x7fffffffffffffffLL); }
ARMDYN_INLINE Lanes least(Lanes a, Lanes b) { return b < a ? b : a; }
ARMDYN_INLINE Lanes most(Lanes a, Lanes b) { return a < b ? b : a; }

// At least the next float outward: S. Rump, P. Zimmermann, S. Boldo, G. Melquiond, Computing predecessor and
// successor in rounding to nearest, BIT 49, 2009: x + (u (1 + 2 u) |x| + the least subnormal number).
ARMDYN_INLINE Lanes room(Lanes x) { return magnitude(x) * (kUnit * (1 + 2 * kUnit)) + 4.94e-324; }
ARMDYN_INLINE Lanes down(Lanes x) { return x - room(x); }
ARMDYN_INLINE Lanes up(Lanes x) { return x + room(x); }

// Upper bound on the rounding error of a sum of products, from the sum of their sizes: four times
// γ = n u / (1 − n u) (N. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed. 2002, section 3.1), since the
// sum and operations on the result are rounded, too.
ARMDYN_INLINE Lanes rounding(int terms, Lanes sizes) { return sizes * (4 * (terms + 2) * kUnit) + kTiny; }
ARMDYN_INLINE double rounding(int terms, double sizes) { return sizes * (4 * (terms + 2) * kUnit) + kTiny; }

}  // namespace armdyn
