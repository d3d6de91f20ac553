"""Stops motors that run on: those of struts without a watchdog whose radio link was lost."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence

from vvvaltr.controller.core.errors import DeviceError, DeviceTimeout
from vvvaltr.drivers.links.gatt import Wanted
from vvvaltr.drivers.struts.opening import open_links

_log = logging.getLogger(__name__)

_WITHIN_S, _ANSWER_S, _AGAIN_S = 5.0, 1.0, 0.1


def stop_runaways(adapter: str, runaways: Sequence[Wanted], stop: bytes, reports: bool) -> None:
    """Look for struts that were lost, for a few seconds each, and stop them; what was not found is warned of.

    Args:
        adapter: as for ``open_links``.
        runaways: the struts.
        stop: the text that stops them.
        reports: whether they send anything.
    """
    for strut in runaways:
        _log.warning("strut %s may still turn: looking for it to stop it; switch it off", strut.strut)
        if _stop(adapter, strut, stop, reports):
            _log.warning("strut %s was found again and stopped", strut.strut)
        else:
            _log.error("strut %s was not found again and may still turn: switch it off", strut.strut)


def _stop(adapter: str, strut: Wanted, stop: bytes, reports: bool) -> bool:
    end_s = time.monotonic() + _WITHIN_S
    while time.monotonic() < end_s:
        try:
            link = open_links(adapter, [strut], reports)
            try:
                link.write(0, stop, is_acknowledged=True)
                answered_s = time.monotonic() + _ANSWER_S
                while (left_s := answered_s - time.monotonic()) > 0.0:
                    if (word := link.read(left_s)) is not None and word.acknowledges:
                        return True
                raise DeviceTimeout(f"strut {strut.strut} does not answer")
            finally:
                link.close()
        except DeviceError as error:
            _log.info("not yet: %s", error)
        time.sleep(_AGAIN_S)
    return False
