# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of a Geometry Nodes modifier by name, in all supported versions of Blender."""


def identifier(modifier, name):
    sockets = modifier.node_group.interface.items_tree
    return next(s.identifier for s in sockets if getattr(s, "in_out", "") == "INPUT" and s.name == name)


def slot(modifier, name):
    """Blender 5.2's property group of an input; None in versions that store inputs as ID properties."""
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    return None if inputs is None else getattr(inputs, identifier(modifier, name))


def get(modifier, name):
    socket = slot(modifier, name)
    return socket.value if socket is not None else modifier[identifier(modifier, name)]


def put(modifier, name, value):
    socket = slot(modifier, name)
    if socket is not None:
        socket.value = value
    else:
        modifier[identifier(modifier, name)] = value
    modifier.id_data.update_tag()


def get_attribute(modifier, name):
    """Name of the attribute or vertex group that an input reads; "" if it is a single value."""
    socket = slot(modifier, name)
    if socket is not None:
        return socket.attribute_name if socket.type == "ATTRIBUTE" else ""
    key = identifier(modifier, name)
    return modifier[f"{key}_attribute_name"] if modifier.get(f"{key}_use_attribute") else ""


def put_attribute(modifier, name, attribute):
    """Sets an input to an attribute or vertex group, or with "" to its single value."""
    socket = slot(modifier, name)
    if socket is not None:
        socket.type = "ATTRIBUTE" if attribute else "VALUE"
        socket.attribute_name = attribute
    else:
        key = identifier(modifier, name)
        modifier[f"{key}_use_attribute"] = bool(attribute)
        modifier[f"{key}_attribute_name"] = attribute
    modifier.id_data.update_tag()
