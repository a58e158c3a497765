"""The types of messages, for annotations: `records.pyi` declares the fields of each.

A message itself is of the class that the type store makes of its .msg file on first use, so at
run time each name here is only a name.
"""


class Message:
    """A message of any type."""


def __getattr__(name: str) -> type[Message]:
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Message
