# SPDX-License-Identifier: GPL-3.0-or-later
"""C++ code of the resolved table: a header per struct, its checks, and the bindings of Python classes."""

import math
import textwrap

NOTE = "// Made by native/options/generate.py from options.toml. Not to be edited."
LICENCE = "// SPDX-License-Identifier: GPL-3.0-or-later"
TYPES = {"int": "int", "float": "double", "bool": "bool", "seed": "std::int64_t", "device": "std::string"}
HINTS = {"int": "int", "float": "float", "bool": "bool", "seed": "int", "device": "str"}


def files(table):
    """{file name: content}."""
    made = {f"options/{name}.h": header(table, name) for name in table}
    made["options/choices.h"] = choices_header(table)
    made["options/options.cpp"] = source(table)
    made["options/bind_options.cpp"] = bindings(table)
    return made


def enums(table):
    """{C++ name of an enum: an option that uses it}."""
    every = [option for block in table.values() for option in (*block["options"], *block["further"])]
    return {option["enum"]: option for option in every if option["enum"]}


def comment(text, indent="", mark="///"):
    width = 108 - len(indent) - len(mark)
    return "".join(f"{indent}{mark} {line}\n" for line in textwrap.wrap(text, width))


def enumerator(choice):
    """The C++ enumerator of a choice; `auto` is a keyword."""
    return {"auto": "automatic"}.get(choice, choice)


def literal(option, value=None):
    """A value of the option as a C++ literal."""
    value = option["default"] if value is None else value
    if option["type"] == "enum":
        return f"{option['enum']}::{enumerator(value)}"
    if option["type"] == "device":
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return "std::numeric_limits<double>::infinity()" if value == math.inf else repr(value)


def cpp_type(option):
    return option["enum"] or TYPES[option["type"]]


def explained(option):
    """The sentence, with the unit if it lacks that, and the meaning of 0."""
    unit = option["unit"] not in option["sentence"].lower()
    text = option["sentence"] + (f" ({option['unit']})" if unit else "")
    for values in option["automatic"].values():
        text += ": " + ", ".join(f"{value:g} for {name}" for name, value in values.items())
    return text + "."


def automatic_rates(block):
    """Yields a function for each option whose 0 stands for other values."""
    for option in block["options"]:
        for by, values in option["automatic"].items():
            chooser = next(o for o in block["options"] if o["name"] == by)
            cases = "".join(f"case {literal(chooser, key)}: return {v!r}; " for key, v in values.items())
            yield (
                f"  /// What 0 stands for.\n"
                f"  static constexpr double automatic_{option['name']}({chooser['enum']} {by}) {{\n"
                f"    switch ({by}) {{ {cases}}}\n    return 0.0;\n  }}\n"
            )


def header(table, name):
    block = table[name]
    includes = ['#include "core/export.h"\n']
    includes += [f'#include "options/{group}.h"\n' for group in block["groups"]]
    if any(option["enum"] and not option["group"] for option in block["options"]):
        includes.append('#include "options/choices.h"\n')
    standard = [f"#include <{header}>\n" for header in ("cstdint", "limits", "string")]
    lines = [
        f"{LICENCE}\n{NOTE}\n#pragma once\n\n",
        *standard,
        "\n",
        *sorted(includes),
        "\nnamespace arapfields {\n\n",
    ]
    lines += [comment(block["about"] + "."), f"struct ARAPFIELDS_EXPORT {block['struct']} {{\n"]
    opened = set()
    for option in block["options"]:
        group = option["group"]
        if not group:
            lines += [comment(explained(option), "  ")]
            lines += [f"  {cpp_type(option)} {option['name']} = {literal(option)};\n"]
        elif group not in opened:
            opened.add(group)
            lines.append(f"  {table[group]['struct']} {group}{changed(table, block, group)};\n")
    lines += automatic_rates(block)
    lines += [
        "\n  /// Throws InvalidInput that names the option, what was found and what is allowed.\n",
        "  void validate() const;\n",
        f"  bool operator==(const {block['struct']}&) const = default;\n}};\n",
    ]
    if block["checks"]:
        lines.append(
            "\n/// The rules on several options at once (options/checks.cpp); validate() calls it.\n"
        )
        lines.append(f"void check_{block['checks']}(const {block['struct']}& options);\n")
    return "".join([*lines, "\n}  // namespace arapfields\n"])


def changed(table, block, group):
    """The initializer of a nested group with other defaults in this operation; or ""."""
    declared = {o["name"]: o["default"] for o in table[group]["options"]}
    other = [o for o in block["options"] if o["group"] == group and o["default"] != declared[o["name"]]]
    values = ", ".join(f".{option['name']} = {literal(option)}" for option in other)
    return f" = {{{values}}}" if other else ""


def choices_header(table):
    lines = [f"{LICENCE}\n{NOTE}\n#pragma once\n\n", "#include <string>\n\n", '#include "core/export.h"\n\n']
    lines += ["namespace arapfields {\n"]
    for enum, option in enums(table).items():
        lines += ["\n", comment(option["sentence"] + "."), f"enum class {enum} {{\n"]
        for choice, (_, sentence) in option["choices"].items():
            lines += [comment(sentence + ".", "  "), f"  {enumerator(choice)},\n"]
        lines.append(f"}};\nARAPFIELDS_EXPORT const char* name_of({enum} value);\n")
        lines.append("/// Throws InvalidInput that names `argument` for a text that is no choice.\n")
        lines.append("ARAPFIELDS_EXPORT void choose(const std::string& text, const std::string& argument, ")
        lines.append(f"{enum}& value);\n")
    return "".join([*lines, "\n}  // namespace arapfields\n"])


def path(option):
    return f"{option['group']}.{option['name']}" if option["group"] else option["name"]


def source(table):
    lines = [f"{LICENCE}\n{NOTE}\n"]
    lines += [f'#include "options/{name}.h"\n' for name in table]
    lines += ['#include "tensors/device.h"\n#include "core/errors.h"\n\nnamespace arapfields {\n']
    for enum, option in enums(table).items():
        names = list(option["choices"])
        cases = "".join(f'    case {enum}::{enumerator(name)}: return "{name}";\n' for name in names)
        tests = "".join(
            f'  if (text == "{name}") return void(value = {enum}::{enumerator(name)});\n' for name in names
        )
        allowed = ", ".join(f"'{name}'" for name in names[:-1]) + f" or '{names[-1]}' is allowed"
        lines.append(
            f'\nconst char* name_of({enum} value) {{\n  switch (value) {{\n{cases}  }}\n  return "";\n}}\n'
            f"\nvoid choose(const std::string& text, const std::string& argument, {enum}& value) {{\n{tests}"
            f'  throw InvalidInput(argument, "\'" + text + "\'", "{allowed}");\n}}\n'
        )
    for block in table.values():
        lines.append(f"\nvoid {block['struct']}::validate() const {{\n")
        for option in block["options"]:
            name, member = option["name"], path(option)
            if option["type"] == "device":
                lines.append(f"  resolve_device({member});\n")
            elif option["high"] == math.inf:
                allowed = f"{option['low']:g} or more is allowed"
                lines.append(f'  require({member} >= {option["low"]!r}, "{name}", number_text({member}),')
                lines.append(f' "{allowed}");\n')
            elif option["low"] is not None:
                lines.append(f'  require_range("{name}", static_cast<double>({member}), ')
                lines.append(f"{float(option['low'])!r}, {float(option['high'])!r});\n")
        if block["checks"]:
            lines.append(f"  check_{block['checks']}(*this);\n")
        lines.append("}\n")
    return "".join([*lines, "\n}  // namespace arapfields\n"])


def hint(option):
    """The type annotation for Python."""
    if option["type"] == "enum":
        return "typing.Literal[" + ", ".join(f"'{name}'" for name in option["choices"]) + "]"
    return HINTS[option["type"]]


def bindings(table):
    """The bindings of the Python classes."""
    bound = [name for name, block in table.items() if block["python"]]
    lines = [f"{LICENCE}\n{NOTE}\n", '#include "bindings/options_binding.h"\n']
    lines += [f'#include "options/{name}.h"\n' for name in bound]
    lines.append(
        "\nnamespace arapfields::python {\n\nvoid bind_options(py::module_& module) {\n  py::object type;\n"
    )
    for name in bound:
        block = table[name]
        struct, about = block["struct"], quoted(block["about"] + ".")
        hints = ", ".join(f"{o['name']}: {hint(o)} = {o['default']!r}" for o in block["options"])
        signature = quoted(f"__init__(self, *, {hints}) -> None")
        lines.append(f'  type = bind_struct<{struct}>(module, "{struct}", {about}, {signature}, {{\n')
        for option in block["options"]:
            kind = cpp_type(option)
            lines.append(
                f'      {{"{option["name"]}", {quoted(hint(option))}, {quoted(explained(option))},\n'
                f"       [](py::handle self) -> void* {{ return &self.cast<{struct}&>().{path(option)}; }},\n"
                f"       &read_option<{kind}>, &write_option<{kind}>}},\n"
            )
        lines.append("  });\n")
        if block["presets"]:
            values = {key: preset["values"] for key, preset in block["presets"].items()}
            lines.append(
                f"  bind_presets(type, {quoted(repr(values))},\n      {quoted(preset_doc(block))});\n"
            )
        aliases = [option for option in block["options"] if option["alias"]]
        lines += [f'  type.attr("{o["alias"]}") = type.attr("{o["name"]}");\n' for o in aliases]
    return "".join([*lines, "}\n\n}  // namespace arapfields::python\n"])


def preset_doc(block):
    names = ", ".join(f"'{name}'" for name in block["presets"])
    sentences = "".join(f"\n'{name}': {preset['sentence']}." for name, preset in block["presets"].items())
    return (
        f"preset(name: typing.Literal[{names}], **changes: typing.Any) -> {block['struct']}\n\n"
        f"Options that go together, with changes. Raises InvalidInput for another name.\n{sentences}"
    )


def quoted(text):
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
