#include "tree.hpp"

#include <stdexcept>
#include <string>

namespace armdyn {
namespace {

void expect(size_t got, size_t want, const char* what) {
  if (got != want)
    throw std::invalid_argument(std::string(what) + ": expected " + std::to_string(want) + " numbers, got " +
                                std::to_string(got));
}

}  // namespace

void check(const Tree& t) {
  const size_t n = t.parent.size();
  expect(t.prismatic.size(), n, "prismatic");
  expect(t.axis.size(), 3 * n, "axis");
  expect(t.placement.size(), 12 * n, "placement");
  expect(t.inertia.size(), 10 * n, "inertia");
  expect(t.armature.size(), n, "armature");
  expect(t.gravity.size(), 3, "gravity");
  for (size_t i = 0; i < n; ++i)
    if (t.parent[i] < -1 || t.parent[i] >= static_cast<int>(i))
      throw std::invalid_argument("parent: a joint's parent must come before it");
  if (t.payload_joint < -1 || t.payload_joint >= static_cast<int>(n))
    throw std::invalid_argument("payload_joint: no such joint");
}

}  // namespace armdyn
