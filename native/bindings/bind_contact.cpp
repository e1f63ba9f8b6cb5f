// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/python_function.h"
#include "solve/contact/contact.h"

namespace arapfields::python {

void bind_contact(py::module_& module) {
  py::class_<Obstacle>(module, "Obstacle", R"(
A solid that a surface stays outside of: an implicit function, negative inside, in mesh coordinates.

An open MeshSdf is a sheet, which nothing passes from either side.)")
      .def(py::init([](const FunctionArgument& function, double margin,
                       const std::optional<ArrayArgument>& placement) {
             require_not_negative("margin", margin);
             Obstacle obstacle{as_function(function, "function"), margin};
             if (placement) obstacle.placement = as_matrix4(*placement, "placement");
             return obstacle;
           }),
           "function"_a, "margin"_a = 0.0, py::kw_only(), "placement"_a = py::none(),
           "`margin`: the distance that is kept, in mesh units. `placement` (4, 4) turns, moves and scales "
           "the "
           "function's space. Nothing passes an obstacle whose placement moves from step to step.")
      .def_property_readonly(
          "function",
          [](const Obstacle& self) {
            return std::const_pointer_cast<ImplicitFunction>(self.function);  // Python changes none
          },
          "The ImplicitFunction.")
      .def_readonly("margin", &Obstacle::margin, "The distance that is kept.")
      .def_readonly("placement", &Obstacle::placement, "(4, 4) from the function's to mesh coordinates.");
  py::class_<Contact>(module, "Contact", R"(
What a surface does not pass: obstacles, a ground at a height along `up`, and itself.

For deform, stylize and LiveDeformer. Handles whose targets lie beyond give way: report.contact says which.)")
      .def(
          py::init([](const ObstaclesArgument& obstacles, std::optional<double> ground,
                      const std::optional<ArrayArgument>& up, bool itself, double friction) {
            Contact contact{as_items<Obstacle>(obstacles, "obstacles", "Obstacles are needed"), ground};
            contact.itself = itself;
            contact.friction = friction;
            if (up) contact.up = as_vec3(*up, "up");
            require_contact(contact);
            return contact;
          }),
          "obstacles"_a = py::tuple(), py::kw_only(), "ground"_a = py::none(), "up"_a = py::none(),
          "itself"_a = false, "friction"_a = Contact().friction,
          "`up` (3,) is z unless given. `itself`: parts do not pass each other, but for what touches or "
          "overlaps at rest. `friction`: Coulomb's coefficient at obstacles and the ground, in step() alone.")
      .def_property_readonly(
          "obstacles", [](const Contact& self) { return self.obstacles; }, "The Obstacles.")
      .def_readonly("up", &Contact::up, "(3,) the direction in which the ground's height counts.")
      .def_readonly("friction", &Contact::friction, "Coulomb's coefficient at obstacles and the ground.")
      .def_readonly("itself", &Contact::itself, "Whether parts of the shape do not pass each other.")
      .def_readonly("ground", &Contact::ground, "The ground's height, or None.");
}

}  // namespace arapfields::python
