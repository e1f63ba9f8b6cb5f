# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of a Geometry Nodes modifier by name, in each Blender's own way."""


def identifier(modifier, name):
    sockets = modifier.node_group.interface.items_tree
    return next(s.identifier for s in sockets if getattr(s, "in_out", "") == "INPUT" and s.name == name)


def slot(modifier, name):
    """Blender 5.2's property group of an input; None in versions whose modifiers hold inputs as items."""
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
    """Name of the attribute or vertex group that an input takes; "" where it is a plain value."""
    socket = slot(modifier, name)
    if socket is not None:
        return socket.attribute_name if socket.type == "ATTRIBUTE" else ""
    key = identifier(modifier, name)
    return modifier[f"{key}_attribute_name"] if modifier.get(f"{key}_use_attribute") else ""


def put_attribute(modifier, name, attribute):
    """Has an input take an attribute or vertex group, or with "" its plain value."""
    socket = slot(modifier, name)
    if socket is not None:
        socket.type = "ATTRIBUTE" if attribute else "VALUE"
        socket.attribute_name = attribute
    else:
        key = identifier(modifier, name)
        modifier[f"{key}_use_attribute"] = bool(attribute)
        modifier[f"{key}_attribute_name"] = attribute
    modifier.id_data.update_tag()


def objects(modifier):
    """What its inputs for objects name."""
    sockets = [
        one for one in modifier.node_group.interface.items_tree if getattr(one, "in_out", "") == "INPUT"
    ]
    return [get(modifier, one.name) for one in sockets if one.socket_type == "NodeSocketObject"]
