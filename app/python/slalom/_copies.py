"""What cannot be copied."""


class NotCopied:
    """An object with a state in C++, which neither `copy` nor `pickle` can copy."""

    _instead = ""  # What to do in place of a copy.

    def __reduce_ex__(self, protocol):
        raise TypeError(f"{type(self).__name__} objects can be neither copied nor pickled: "
                        f"{self._instead}")
