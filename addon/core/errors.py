# SPDX-License-Identifier: GPL-3.0-or-later


class UserError(Exception):
    """What the user should read: which object, what is wrong, what to do.

    A template with its values, so that the template can be translated where it is shown; {name} is that of
    `named`, an object or what stands for one.
    """

    def __init__(self, template, named=None, **values):
        if named is not None:
            values["name"] = named.name
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values

    def says(self, name):
        """Whether the text has a name in it, be it by an error that is quoted."""
        return any(
            value.says(name) if isinstance(value, UserError) else value == name
            for value in self.values.values()
        )


def as_user_error(error):
    """The same as a UserError; a system's refusal by path and reason, without its number."""
    if isinstance(error, UserError):
        return error
    if isinstance(error, OSError) and error.filename is not None:
        return UserError("{path}: {error}", path=error.filename, error=error.strerror)
    return UserError("{error}", error=error)


def refuse(reason):
    """Raises a reason, where there is one."""
    if reason is not None:
        raise reason
