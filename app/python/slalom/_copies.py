"""What cannot be copied."""


class NotCopied:
    """An object with a state in C++, which neither `copy` nor `pickle` can copy."""

    _instead = ""  # What to do in place of a copy.

    def __reduce_ex__(self, protocol):
        raise TypeError(f"a {type(self).__name__} can be neither copied nor pickled: {self._instead}")
