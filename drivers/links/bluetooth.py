"""Radio links over the computer's own Bluetooth adapter, by bleak, in a thread with an event loop of its own.

Left alone, bleak's writes wait for ever for a device that has gone, and a connection that fails can take ten seconds
more to clean up: everything here has an end.
"""

from __future__ import annotations

import asyncio
import logging
import queue
import threading
import time
from collections.abc import Coroutine, Sequence
from concurrent.futures import TimeoutError as FutureTimeout
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

from bleak import BleakAdapter, BleakClient, BleakScanner
from bleak.exc import BleakError

from vvvaltr.controller.core.errors import DeviceError, DeviceFault, DeviceTimeout, LinkLost
from vvvaltr.drivers.links.bluetooth_trouble import explained
from vvvaltr.drivers.links.gatt import Wanted, Word, are_all_found, find_addresses

if TYPE_CHECKING:
    from bleak.backends.characteristic import BleakGATTCharacteristic
    from bleak.backends.device import BLEDevice
    from bleak.backends.scanner import AdvertisementData

T = TypeVar("T")

_SCAN_S = 10.0
_DOUBLES_S = 0.7  # to go on listening after the last strut was found, for a second one of the same name
_CONNECT_S, _WRITE_S, _CLOSE_S, _SPARE_S = 10.0, 1.0, 2.0, 3.0
_LOOK_S = 0.02
_GENERIC = ("00001800", "00001801")  # services that every device has
_RFDUINO = "00002222-0000-1000-8000-00805f9b34fb"  # what a host writes, in the boards' own library

for _name in ("bleak", "dbus_fast"):
    logging.getLogger(_name).addHandler(logging.NullHandler())  # what they say is told by us, once, in one line


def scan_bluetooth(adapter: str, timeout_s: float) -> dict[str, str]:
    """Return name by address of all that is in the air; the name is empty where there is none. Raises DeviceError."""
    loop = _Loop()
    try:
        return {address: name for address, (name, _) in loop.run(_scan(adapter, (), timeout_s), timeout_s).items()}
    finally:
        loop.close()


class BluetoothLink:
    """Satisfies ``GattLink``.

    Args:
        adapter: name of the adapter; empty for the first one.
        wanted: the struts.
        reports: whether they send anything.

    Raises:
        DeviceError: there is no Bluetooth, or it may not be used.
        DeviceTimeout: a strut is not in the air, or does not let itself be connected.
        DeviceFault: two have one name, or one is no strut.
    """

    def __init__(self, adapter: str, wanted: Sequence[Wanted], reports: bool) -> None:
        self.name = adapter or "Bluetooth"
        self._words: queue.SimpleQueue[Word | None] = queue.SimpleQueue()
        self._problem: LinkLost | None = None
        self._peers: list[_Peer] = []
        self._loop = _Loop()
        try:
            self._loop.run(self._open(adapter, wanted, reports), _SCAN_S + 2.0 * _CONNECT_S)
        except BaseException:
            self.close()
            raise

    def write(self, strut: int, text: bytes, is_acknowledged: bool) -> None:
        """Send a text soon. Raises LinkLost."""
        if (problem := self._peers[strut].problem) is not None:
            raise problem
        self._loop.call(self._peers[strut].offer, text, is_acknowledged)

    def read(self, timeout_s: float) -> Word | None:
        """Return what came next. Raises LinkLost."""
        if self._problem is not None:
            raise self._problem
        try:
            word = self._words.get(timeout=max(0.0, timeout_s))
        except queue.Empty:
            return None
        if word is None and self._problem is not None:
            raise self._problem
        return word

    def close(self) -> None:
        """Send what has not been sent yet, then disconnect."""
        if self._peers:
            with suppress(DeviceError):
                self._loop.run(self._release(), 2.0 * _CLOSE_S)
            self._peers = []
        self._loop.close()

    async def _open(self, adapter: str, wanted: Sequence[Wanted], reports: bool) -> None:
        seen = await _scan(adapter, wanted, _SCAN_S)
        addresses = find_addresses(wanted, {address: name for address, (name, _) in seen.items()})
        self._peers = [
            _Peer(number, strut, seen[address][1], self._words, self._lose)
            for number, (strut, address) in enumerate(zip(wanted, addresses, strict=True))
        ]
        await asyncio.gather(*(peer.open(reports) for peer in self._peers))

    async def _release(self) -> None:
        await asyncio.gather(*(peer.close() for peer in self._peers))

    def _lose(self, problem: LinkLost) -> None:
        self._problem = self._problem or problem
        self._words.put(None)  # wakes up who waits


class _Peer:
    """The link to one strut; everything happens in the event loop."""

    def __init__(self, number: int, wanted: Wanted, device: BLEDevice, words: Any, lose: Any) -> None:
        self.problem: LinkLost | None = None
        self._number = number
        self._wanted = wanted
        self._words = words
        self._lose = lose
        self._client = BleakClient(device, disconnected_callback=lambda _: self._on_loss(), timeout=_CONNECT_S)
        self._offered: tuple[bytes, bool] | None = None
        self._has_news = asyncio.Event()
        self._is_closing = False
        self._writer: asyncio.Task[None] | None = None

    async def open(self, reports: bool) -> None:
        """Connect, find the characteristic, and let it report. Raises DeviceError."""
        name = f"strut {self._wanted.strut}"
        try:
            with explained(name):
                async with asyncio.timeout(_CONNECT_S):
                    await self._client.connect()
                    self._target = self._characteristic(reports)
                    if reports:
                        await self._client.start_notify(self._target, lambda _, text: self._hear(bytes(text)))
        except TimeoutError:
            raise DeviceTimeout(f"{name} does not let itself be connected; switch it off and on") from None
        self._writer = asyncio.create_task(self._write())

    def offer(self, text: bytes, is_acknowledged: bool) -> None:
        """Send a text as soon as the one before it has gone."""
        self._offered = text, is_acknowledged
        self._has_news.set()

    async def close(self) -> None:
        """Send what was offered, then disconnect, each within its time."""
        self._is_closing = True
        end_s = time.monotonic() + _CLOSE_S
        while self._has_news.is_set() and self.problem is None and time.monotonic() < end_s:
            await asyncio.sleep(_LOOK_S)
        if self._writer is not None:
            self._writer.cancel()
        with suppress(Exception):  # a link that is broken in any way is left to the system
            await asyncio.wait_for(self._client.disconnect(), _CLOSE_S)

    def _hear(self, text: bytes) -> None:
        self._words.put(Word(self._number, time.monotonic(), text))

    async def _write(self) -> None:
        while True:
            await self._has_news.wait()
            if (offered := self._offered) is None:
                self._has_news.clear()  # only now: the one before has gone
                continue
            self._offered = None
            text, is_acknowledged = offered
            try:
                async with asyncio.timeout(_WRITE_S):
                    await self._client.write_gatt_char(self._target, text, response=is_acknowledged)
            except (BleakError, OSError, EOFError, TimeoutError) as error:
                return self._on_loss(f" ({str(error) or 'no answer'})")
            if is_acknowledged:
                self._words.put(Word(self._number, time.monotonic(), text, acknowledges=True))

    def _on_loss(self, why: str = "") -> None:
        if self._is_closing or self.problem is not None:
            return
        self.problem = LinkLost(
            f"the radio link to strut {self._wanted.strut} is lost{why}; bring it nearer, check its battery"
        )
        self._lose(self.problem)

    def _characteristic(self, reports: bool) -> BleakGATTCharacteristic:
        """Return the characteristic that is written to, and reports. Raises DeviceFault if there is not one alone."""
        wanted = self._wanted.characteristic.lower() or ("" if reports else _RFDUINO)
        serving = [
            found
            for service in self._client.services
            if not service.uuid.startswith(_GENERIC)
            for found in service.characteristics
            if (not wanted or found.uuid.lower() in (wanted, f"0000{wanted}-0000-1000-8000-00805f9b34fb"))
            and {"write", "write-without-response"} & set(found.properties)
            and (not reports or "notify" in found.properties)
        ]
        if len(serving) != 1:
            count = f"{len(serving)} characteristics" if serving else "no characteristic"
            what = f" {wanted}" if wanted else ""
            raise DeviceFault(
                "characteristic",
                f"{self._wanted.strut} has {count}{what} of a strut; put the UUID of the right one in the robot's "
                "file, as characteristic, or correct strut",
            )
        return serving[0]


class _Loop:
    """An event loop in a thread."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="Bluetooth", daemon=True)
        self._thread.start()

    def run(self, work: Coroutine[Any, Any, T], within_s: float) -> T:
        """Return what ``work`` does in the loop. Raises DeviceTimeout if it never ends, and what it raises."""
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result(within_s + _SPARE_S)
        except FutureTimeout as error:
            if future.done():
                raise error
            future.cancel()
            raise DeviceTimeout(
                f"Bluetooth hangs: it did not answer for {within_s:.0f} s; restart it by sudo "
                "systemctl restart bluetooth"
            ) from None

    def call(self, act: Any, *arguments: Any) -> None:
        """Let the loop call ``act`` soon."""
        with suppress(RuntimeError):  # it has been closed
            self._loop.call_soon_threadsafe(act, *arguments)

    def close(self) -> None:
        """End the thread. Idempotent."""
        if not self._thread.is_alive():
            return
        with suppress(Exception):
            asyncio.run_coroutine_threadsafe(_cancel_all(), self._loop).result(_SPARE_S)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_SPARE_S)
        if not self._thread.is_alive():
            self._loop.close()


async def _cancel_all() -> None:
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.wait(tasks, timeout=_CLOSE_S) if tasks else None


async def _scan(adapter: str, wanted: Sequence[Wanted], duration_s: float) -> dict[str, tuple[str, BLEDevice]]:
    """Return name and device by address; ends early once all that is wanted was found."""
    seen: dict[str, tuple[str, BLEDevice]] = {}

    def note(device: BLEDevice, advertised: AdvertisementData | None = None) -> None:
        seen[device.address] = ((advertised.local_name if advertised else None) or device.name or "", device)

    options: Any = {"adapter": adapter} if adapter else {}
    with explained(adapter or "Bluetooth"):
        async with BleakScanner(detection_callback=note, bluez=options):
            # A program that was killed leaves its links up, and what is linked is not in the air.
            for device in await (await BleakAdapter.get(bluez=options)).get_connected_devices():
                note(device)
            end_s = time.monotonic() + duration_s
            while time.monotonic() < end_s:
                await asyncio.sleep(_LOOK_S)
                if wanted and are_all_found(wanted, {address: name for address, (name, _) in seen.items()}):
                    end_s, wanted = min(end_s, time.monotonic() + _DOUBLES_S), ()
    return seen
