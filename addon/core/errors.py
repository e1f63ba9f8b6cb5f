# SPDX-License-Identifier: GPL-3.0-or-later


class UserError(Exception):
    """An error message for the user: which object, what is wrong, what to do.

    Holds a template and its values, so that the template is translated where it is shown; {name} is the name
    of `named`, an object or a reference to one.
    """

    def __init__(self, template, named=None, **values):
        if named is not None:
            values["name"] = named.name
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values

    def says(self, name):
        """Whether the text contains a name, directly or in a nested UserError."""
        return any(
            value.says(name) if isinstance(value, UserError) else value == name
            for value in self.values.values()
        )


def as_user_error(error):
    """Converts an error to a UserError; an OSError with path and reason, without errno."""
    if isinstance(error, UserError):
        return error
    if isinstance(error, OSError) and error.filename is not None:
        return UserError("{path}: {error}", path=error.filename, error=error.strerror)
    return UserError("{error}", error=error)


def refuse(reason):
    """Raises the reason unless it is None."""
    if reason is not None:
        raise reason
