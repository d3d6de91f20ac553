"""Units of work on a Dask cluster instead of this computer's processes."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from vvvaltr.controller.core.errors import UserError


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Yield the workers of the Dask cluster whose scheduler is at ``address``. They need vvvaltr installed.

    Raises:
        UserError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise UserError('a cluster needs Dask: pip install "vvvaltr[cluster]"') from None
    try:
        client = Client(address, timeout=10)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise UserError(
            f"--scheduler {address}: no Dask scheduler answers ({error}); start one with: dask scheduler"
        ) from None
    with client, client.get_executor(pure=False) as executor:  # type: ignore[no-untyped-call]
        yield executor
