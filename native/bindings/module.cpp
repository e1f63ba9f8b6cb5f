// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/ended_interpreter.h"
#include "bindings/files.h"
#include "bindings/uninitialised.h"
#include "bindings/wrong_types.h"

PYBIND11_MODULE(_native, module) {
  using namespace arapfields::python;
  module.doc() = "Native part of arapfields.";
  module.attr("__version__") = ARAPFIELDS_VERSION;
  stop_in_numpy();
  bind_core(module);
  bind_options(module);
  bind_mesh(module);
  bind_distance(module);
  bind_neural(module);
  bind_mesh_sdf(module);
  bind_sampling(module);
  bind_fit(module);
  bind_fields(module);
  bind_energies(module);
  bind_object_style(module);
  bind_contact(module);
  bind_solve(module);
  bind_extraction(module);
  bind_radial(module);
  bind_wrap(module);
  bind_attach(module);
  bind_curve(module);
  bind_sharpen(module);
  bind_skin(module);
  bind_splats(module);
  bind_io(module);
  bind_solve_testing(module);
  bind_invertible_testing(module);
  refuse_uninitialised(module);
  name_wrong_types(module);
}
