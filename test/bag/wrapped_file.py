"""A file that passes everything on to another, for tests that come between the two."""

import io


class WrappedFile(io.RawIOBase):
    """An unbuffered file in front of ``raw``; what is written is for a subclass to say."""

    def __init__(self, raw):
        self._raw = raw
        self.name = raw.name

    def writable(self):
        return True

    def seekable(self):
        return True

    def fileno(self):
        return self._raw.fileno()

    def tell(self):
        return self._raw.tell()

    def seek(self, place, whence=0):
        return self._raw.seek(place, whence)

    def truncate(self, size=None):
        return self._raw.truncate(size)

    def close(self):
        self._raw.close()
        super().close()
