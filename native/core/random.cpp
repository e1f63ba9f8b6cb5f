// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/random.h"

#include <cmath>
#include <numbers>

namespace arapfields {
namespace {

// Finalizer of splitmix64 (Steele, Lea, Flood 2014: "Fast splittable pseudorandom number generators").
std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

constexpr std::uint64_t golden_gamma = 0x9e3779b97f4a7c15ULL;

}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream)
    : key_(mix(seed + golden_gamma) ^ mix(mix(stream + 0x632be59bd9b4e019ULL))) {}

std::uint64_t Random::bits() { return mix(key_ + golden_gamma * ++counter_); }

double Random::uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

// The upper half of a 128-bit product (Lemire 2019, "Fast Random Integer Generation in an Interval", section
// 4); without its rejection step the bias is at most count / 2^64.
Index Random::below(Index count) {
  return static_cast<Index>((static_cast<unsigned __int128>(bits()) * static_cast<std::uint64_t>(count)) >>
                            64);
}

// Box and Muller 1958, "A Note on the Generation of Random Normal Deviates".
double Random::normal() {
  const double radius = std::sqrt(-2.0 * std::log1p(-uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

// Archimedes: the height of a uniform point on the sphere is uniform.
Vec3 Random::direction() {
  const double z = uniform(-1.0, 1.0), angle = 2.0 * std::numbers::pi * uniform();
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

}  // namespace arapfields
