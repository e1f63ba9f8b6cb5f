// SPDX-License-Identifier: GPL-3.0-or-later
// Terms of an objective: a new one joins every solve, and all agree in both precisions and on a device.
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "energies/composed_energies.h"
#include "energies/styles.h"
#include "shapes.h"
#include "solve/deform.h"
#include "solve/jet_terms.h"
#include "solve/radial/radial_solver.h"
#include "solve/stylize.h"
#include "tensors/views.h"

using namespace arapfields;

namespace {

/// weight · mean ‖f(x) − x − offset‖²: a term of this file alone.
class Pull final : public JetTermOf<Pull> {
 public:
  Pull(const Vec3& offset, double weight) : offset_(offset), weight_(weight) {}
  std::string name() const override { return "pull"; }
  JetOrder order() const override { return JetOrder::value; }
  void set_batch(const TermBatch& batch) override {
    goals_ = PointsInBoth(Points(batch.points.rowwise() + offset_.transpose()));
  }
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const {
    const PointsOf<Scalar> off =
        Eigen::Map<const PointsOf<Scalar>>(jets.data, jets.count, 3) - goals_.in<Scalar>();
    const double share = weight_ / static_cast<double>(jets.count);
    if (cotangents.data != nullptr)
      Eigen::Map<PointsOf<Scalar>>(cotangents.data, jets.count, 3) += static_cast<Scalar>(2.0 * share) * off;
    return share * static_cast<double>(off.squaredNorm());
  }

 private:
  Vec3 offset_;
  double weight_;
  PointsInBoth goals_;
};

SurfaceSamples ball() {
  Random random(3);
  SurfaceSamples samples;
  samples.points.resize(800, 3);
  for (Index i = 0; i < samples.size(); ++i) samples.points.row(i) = 0.7 * random.direction().transpose();
  samples.normals = samples.points / 0.7;
  return samples;
}

/// Holds the ball's lower third.
std::vector<Handle> bottom() {
  Handle handle;
  handle.rest.diagonal() << 1.0, 1.0, 0.4, 1.0;
  handle.rest(2, 3) = handle.target(2, 3) = -0.7;
  handle.target = handle.rest;
  return {handle};
}

const Vec3 aside(0.2, 0.1, 0.0);

bool lists(const std::vector<LossTerm>& terms, const std::string& name) {
  return std::any_of(terms.begin(), terms.end(), [&](const LossTerm& term) { return term.name == name; });
}

/// Mean displacement of the upper half, as a share of `aside`.
double followed(const DeformationField& field, const SurfaceSamples& samples) {
  const Points moved = field.at(samples.points) - samples.points;
  double sum = 0.0;
  Index count = 0;
  for (Index i = 0; i < samples.size(); ++i)
    if (samples.points(i, 2) > 0.0) sum += moved.row(i).dot(aside) / aside.squaredNorm(), ++count;
  return sum / static_cast<double>(count);
}

/// Hooks with a strong pull, which record whether each iteration lists it.
struct Watched {
  SolveHooks hooks;
  int seen = 0;
  int listed = 0;

  Watched() {
    hooks.terms = {std::make_shared<Pull>(aside, 10.0)};
    hooks.observer = [this](const Iteration& iteration) {
      ++seen;
      listed += lists(iteration.terms, "pull") ? 1 : 0;
      double sum = 0.0;
      for (const LossTerm& term : iteration.terms) sum += term.value;
      BOOST_TEST(std::abs(sum - iteration.loss) <= 1e-9 * std::abs(iteration.loss) + 1e-12);
      return true;
    };
  }
  void check(const Solution& solution, const SurfaceSamples& samples) {
    BOOST_TEST(seen > 0);
    BOOST_TEST(listed == seen);
    BOOST_TEST(lists(solution.report.terms, "pull"));
    BOOST_TEST(lists(solution.report.terms, "stretch"));
    BOOST_TEST(followed(*solution.field, samples) > 0.5);
  }
};

TermBatch batch_of(const SurfaceSamples& samples) {
  Random random(5);
  TermBatch batch{samples.points, samples.normals, Vector(samples.size()), Vector(samples.size()), {}};
  for (Index i = 0; i < samples.size(); ++i) {
    batch.weights[i] = random.uniform(0.5, 2.0);
    batch.bending[i] = random.uniform(0.0, 0.02);
  }
  return batch;
}

/// Jets near the identity's.
template <class Scalar>
JetBlock<Scalar> jets_near_rest(const SurfaceSamples& samples) {
  Random random(7);
  JetBlock<Scalar> block(samples.size(), JetOrder::second);
  const JetView<Scalar> jets = block.view();
  for (Index p = 0; p < samples.size(); ++p)
    for (int c = 0; c < 10; ++c)
      for (int i = 0; i < 3; ++i) {
        const double rest = c == 0 ? samples.points(p, i) : (c == i + 1 ? 1.0 : 0.0);
        jets.at(c, p)[i] = static_cast<Scalar>(rest + 0.05 * random.normal());
      }
  return block;
}

JetTermList every_term(const SurfaceSamples& samples) {
  JetTermSettings settings;
  settings.style = StyleAtSamples::of(Style(preferred_normals("cube")), samples.normals, 5.0);
  settings.gauss = 0.7;
  settings.stance = Stance::of(samples.points, Vec3::UnitZ());
  settings.keep_stance = 0.6;
  settings.barrier = 0.5;
  settings.barrier_threshold = 0.99;
  Locality& locality = settings.locality;
  locality.options = {.locality = 0.8, .locality_limit = 0.06, .locality_smoothing = 0.02};
  locality.motion.topRightCorner<3, 1>() = Vec3(0.02, 0.0, -0.03);
  locality.shares = Vector::Ones(samples.size());
  locality.shares.head(100).setZero();
  settings.body = Body<double>{Vector::Ones(samples.size()), samples.points, 1.1 * samples.points, 0.4};
  settings.further = {std::make_shared<Pull>(aside, 0.3)};
  const JetTermList list(settings);
  list.set_batch(batch_of(samples));
  return list;
}

template <class Call>
void for_each_of(const JetTermList& list, Call&& call) {
  for (const auto& term : list.own) call(*term);
  for (const auto& term : list.callers) call(*term);
}

}  // namespace

BOOST_AUTO_TEST_SUITE(terms)

BOOST_AUTO_TEST_CASE(a_new_term_joins_deform_with_both_kinds_of_field) {
  const SurfaceSamples samples = ball();
  for (const FieldKind kind : {FieldKind::radial, FieldKind::neural}) {
    DeformOptions options;
    options.field = kind;
    options.centers = 60;
    options.network.width = 16;
    options.network.layers = 2;
    options.training.iterations = 150;
    options.training.batch = 150;
    Watched watched;
    watched.check(deform(samples, bottom(), options, {}, watched.hooks), samples);
  }
}

BOOST_AUTO_TEST_CASE(a_new_term_joins_stylize_with_its_full_weight) {
  const SurfaceSamples samples = ball();
  for (const double rigidity : {1.0, 4.0}) {
    StylizeOptions options;
    options.rigidity = rigidity;
    options.training.iterations = 20;
    Watched watched;
    watched.check(stylize(samples, Style(preferred_normals("cube")), options, {}, {}, bottom(), Vec3::UnitZ(),
                          watched.hooks),
                  samples);
  }
}

BOOST_AUTO_TEST_CASE(a_new_term_joins_live_solves) {
  const SurfaceSamples samples = ball();
  LiveOptions options;
  options.samples = 400;
  options.fine_centers = 60;
  RadialSolver solver(samples, bottom(), options);
  int listed = 0;
  solver.set_hooks({{},
                    1.0,
                    [&](const std::vector<LossTerm>& terms) {
                      listed += lists(terms, "pull") ? 1 : 0;
                      return true;
                    },
                    {std::make_shared<Pull>(aside, 10.0)}});
  const auto field = solver.solve(50);
  BOOST_TEST(listed > 0);
  BOOST_TEST(lists(solver.report().terms, "pull"));
  BOOST_TEST(followed(*field, samples) > 0.5);
}

BOOST_AUTO_TEST_CASE(every_term_has_the_cotangents_of_its_value) {
  const SurfaceSamples samples = ball();
  const JetTermList list = every_term(samples);
  JetBlock<double> block = jets_near_rest<double>(samples);
  const JetView<double> jets = block.view();
  for_each_of(list, [&](const JetTerm& term) {
    JetBlock<double> slopes(samples.size(), JetOrder::second);
    term.evaluate(jets, slopes.view(), nullptr);
    Random random(11);
    JetBlock<double> there = block, back = block;
    constexpr double step = 1e-6;
    double expected = 0.0;
    for (Index k = 0; k < jets.size(); ++k) {
      const double along = random.normal();
      there.view().data[k] += step * along;
      back.view().data[k] -= step * along;
      expected += along * slopes.view().data[k];
    }
    const auto value = [&](JetBlock<double>& at) {
      return term.evaluate(JetView<const double>(at.view()), {}, nullptr);
    };
    const double found = (value(there) - value(back)) / (2.0 * step);
    BOOST_TEST(std::abs(found - expected) < 1e-5 * (1.0 + std::abs(expected)), term.name());
  });
}

BOOST_AUTO_TEST_CASE(every_term_agrees_in_both_precisions_and_composed) {
  const SurfaceSamples samples = ball();
  const JetTermList list = every_term(samples);
  JetBlock<double> exact = jets_near_rest<double>(samples);
  JetBlock<float> single = jets_near_rest<float>(samples);
  const EnergyTables tables(tensor_view(exact.view()));
  for_each_of(list, [&](const JetTerm& term) {
    JetBlock<double> slopes(samples.size(), JetOrder::second), composed = slopes;
    JetBlock<float> rough(samples.size(), JetOrder::second);
    std::vector<LossTerm> parts;
    std::vector<ComposedPart> composed_parts;
    const double value = term.evaluate(JetView<const double>(exact.view()), slopes.view(), &parts);
    const double rounded = term.evaluate(JetView<const float>(single.view()), rough.view(), nullptr);
    const double other =
        term.compose(tensor_view(exact.view()), tables, tensor_view(composed.view()), composed_parts)
            .number();
    BOOST_TEST(std::abs(rounded - value) < 1e-4 * std::abs(value), term.name());
    BOOST_TEST(std::abs(other - value) < 1e-9 * std::abs(value), term.name());
    const Eigen::Map<const Vector> a(slopes.view().data, slopes.view().size()),
        b(composed.view().data, composed.view().size());
    const Eigen::Map<const VectorF> c(rough.view().data, rough.view().size());
    BOOST_TEST((a - b).norm() < 1e-9 * a.norm(), term.name());
    BOOST_TEST((a - c.cast<double>()).norm() < 1e-3 * a.norm(), term.name());
    double sum = 0.0;
    BOOST_REQUIRE(parts.size() == composed_parts.size());
    for (std::size_t i = 0; i < parts.size(); ++i) {
      sum += parts[i].value;
      BOOST_TEST(parts[i].name == composed_parts[i].name);
      BOOST_TEST(std::abs(parts[i].value - composed_parts[i].value.number()) < 1e-9 * std::abs(value));
    }
    BOOST_TEST(std::abs(sum - value) < 1e-12 * std::abs(value), term.name());
  });
}

BOOST_AUTO_TEST_SUITE_END()
