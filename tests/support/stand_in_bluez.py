"""A stand-in for BlueZ on a private D-Bus: an adapter, and struts with our firmware that can be found and connected.

Only what bleak asks of it. The radio itself, and what BlueZ does with it, is not here.
"""

from __future__ import annotations

import asyncio
import subprocess
import threading
import time
from typing import Any, Self

from dbus_fast import Message, MessageType, Variant
from dbus_fast.aio import MessageBus

from vvvaltr.drivers.struts.boards import OwnBoard

ADAPTER = "/org/bluez/hci0"
UUID = "5c3a6d3e-0000-4c2b-9d53-1f1b6a0f0001"
_TICK_S = 0.004


class Peripheral:
    """A strut as BlueZ shows it."""

    def __init__(self, number: int, name: str) -> None:
        self.name = name
        self.address = f"24:0A:C4:00:00:{number:02X}"
        self.path = f"{ADAPTER}/dev_{self.address.replace(':', '_')}"
        self.char = f"{self.path}/service0001/char0002"
        self.board = OwnBoard(time.monotonic())
        self.is_connected = self.is_notifying = False
        self.is_deaf = False  # never answers a write
        self.uuid = UUID
        self.writes: list[tuple[bytes, str]] = []

    def objects(self) -> dict[str, dict[str, dict[str, Variant]]]:
        device = {
            "Address": Variant("s", self.address),
            "AddressType": Variant("s", "public"),
            "Name": Variant("s", self.name),
            "Alias": Variant("s", self.name),
            "Adapter": Variant("o", ADAPTER),
            "Connected": Variant("b", self.is_connected),
            "Paired": Variant("b", False),
            "ServicesResolved": Variant("b", self.is_connected),
            "UUIDs": Variant("as", ["00001801-0000-1000-8000-00805f9b34fb", self.uuid]),
            "ManufacturerData": Variant("a{qv}", {}),
            "ServiceData": Variant("a{sv}", {}),
        }
        service = {
            "UUID": Variant("s", self.uuid),
            "Device": Variant("o", self.path),
            "Primary": Variant("b", True),
        }
        characteristic = {
            "UUID": Variant("s", self.uuid),
            "Service": Variant("o", f"{self.path}/service0001"),
            "Flags": Variant("as", ["read", "write", "write-without-response", "notify"]),
            "Notifying": Variant("b", self.is_notifying),
            "MTU": Variant("q", 247),
        }
        return {
            self.path: {"org.bluez.Device1": device},
            f"{self.path}/service0001": {"org.bluez.GattService1": service},
            self.char: {"org.bluez.GattCharacteristic1": characteristic},
        }


class StandInBluez:
    """The stand-in, on a bus of its own; for a ``with`` statement.

    Args:
        names: of the struts in the air.
        has_adapter: whether there is one.
        is_powered: whether that is on.
        is_there: whether BlueZ runs at all on the bus.
        refusal: a D-Bus error that every call gets; empty for none.
    """

    def __init__(
        self,
        *names: str,
        has_adapter: bool = True,
        is_powered: bool = True,
        is_there: bool = True,
        refusal: str = "",
    ) -> None:
        self.peripherals = [Peripheral(number, name) for number, name in enumerate(names, start=1)]
        self._has_adapter = has_adapter
        self._is_powered = is_powered
        self._is_there = is_there
        self._refusal = refusal
        self._daemon = subprocess.Popen(
            ["dbus-daemon", "--session", "--nofork", "--print-address"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self._daemon.stdout is not None
        self.address = self._daemon.stdout.readline().strip()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._call(self._start())
        self._ticking = asyncio.run_coroutine_threadsafe(self._tick(), self._loop)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ticking.cancel()
        self._call(self._end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
        self._daemon.terminate()
        self._daemon.communicate()

    def drop(self, peripheral: Peripheral) -> None:
        """Lose the link to a strut."""
        self._loop.call_soon_threadsafe(self._set_connected, peripheral, False)

    def _call(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(5.0)

    async def _start(self) -> None:
        self._bus = await MessageBus(bus_address=self.address).connect()
        self._bus.add_message_handler(self._answer)
        if self._is_there:
            await self._bus.request_name("org.bluez")

    async def _end(self) -> None:
        self._bus.disconnect()
        await asyncio.sleep(0.01)

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(_TICK_S)
            for peripheral in self.peripherals:
                said = peripheral.board.tick(time.monotonic())
                if said and peripheral.is_notifying and peripheral.is_connected:
                    value = {"Value": Variant("ay", said)}
                    self._change(peripheral.char, "org.bluez.GattCharacteristic1", value)

    def _answer(self, message: Message) -> Message | bool | None:
        if message.message_type is not MessageType.METHOD_CALL or message.interface == "org.freedesktop.DBus":
            return None
        if self._refusal:
            return Message.new_error(message, self._refusal, "not for you")
        if message.member == "GetManagedObjects":
            return Message.new_method_return(message, "a{oa{sa{sv}}}", [self._objects()])
        found = [one for one in self.peripherals if (message.path or "").startswith(one.path)]
        if found:
            return self._answer_peripheral(message, found[0])
        if message.member == "StartDiscovery":
            self._loop.call_later(0.01, self._advertise)
        return Message.new_method_return(message)

    def _answer_peripheral(self, message: Message, peripheral: Peripheral) -> Message | bool:
        match message.member:
            case "Connect" | "Disconnect":
                self._set_connected(peripheral, message.member == "Connect")  # told before the answer, as BlueZ does
            case "StartNotify" | "StopNotify":
                peripheral.is_notifying = message.member == "StartNotify"
            case "WriteValue":
                text, options = bytes(message.body[0]), message.body[1]
                if peripheral.is_deaf:
                    return True  # handled, and never answered
                peripheral.writes.append((text, options["type"].value))
                peripheral.board.write(text, time.monotonic())
        return Message.new_method_return(message)

    def _objects(self) -> dict[str, Any]:
        objects: dict[str, Any] = {}
        if self._has_adapter:
            adapter = {
                "Address": Variant("s", "00:11:22:33:44:55"),
                "Powered": Variant("b", self._is_powered),
                "Roles": Variant("as", ["central"]),
            }
            objects[ADAPTER] = {"org.bluez.Adapter1": adapter}
        for peripheral in self.peripherals:
            objects |= peripheral.objects()
        return objects

    def _advertise(self) -> None:
        for peripheral in self.peripherals:
            if not peripheral.is_connected:
                self._change(peripheral.path, "org.bluez.Device1", {"RSSI": Variant("n", -50)})

    def _set_connected(self, peripheral: Peripheral, is_connected: bool) -> None:
        if peripheral.is_connected == is_connected:
            return
        peripheral.is_connected = is_connected
        if is_connected:
            peripheral.board.connect()
        else:
            peripheral.board.disconnect()
            peripheral.is_notifying = False
        changed = {"Connected": Variant("b", is_connected), "ServicesResolved": Variant("b", is_connected)}
        self._change(peripheral.path, "org.bluez.Device1", changed)

    def _change(self, path: str, interface: str, changed: dict[str, Variant]) -> None:
        self._bus.send(
            Message.new_signal(
                path, "org.freedesktop.DBus.Properties", "PropertiesChanged", "sa{sv}as", [interface, changed, []]
            )
        )
