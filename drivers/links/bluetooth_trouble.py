"""What the errors of bleak and D-Bus mean: cause and cure in one line."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from bleak.exc import (
    BleakBluetoothNotAvailableError,
    BleakBluetoothNotAvailableReason,
    BleakDBusError,
    BleakDeviceNotFoundError,
    BleakError,
)

from vvvaltr.controller.core.errors import DeviceError, LinkLost

_CURES = {
    BleakBluetoothNotAvailableReason.NO_BLUETOOTH: "this computer has no Bluetooth adapter; plug one in",
    BleakBluetoothNotAvailableReason.NO_BLE_CENTRAL_ROLE: "its Bluetooth adapter has no Low Energy; plug in another",
    BleakBluetoothNotAvailableReason.POWERED_OFF: (
        "the Bluetooth adapter is off; switch it on by bluetoothctl power on, after rfkill unblock bluetooth if need be"
    ),
}
_DENIED = (
    "you may not use Bluetooth here; join its group by sudo usermod -aG bluetooth $USER, then log out and in again"
)
_NO_SERVICE = "no Bluetooth service runs here; sudo apt install bluez, then sudo systemctl start bluetooth"
_NO_BUS = "this computer has no D-Bus, which Bluetooth needs; sudo apt install dbus bluez"


@contextmanager
def explained(name: str) -> Iterator[None]:
    """Raise DeviceError, one line with the cure, for what bleak and D-Bus raise."""
    try:
        yield
    except (DeviceError, TimeoutError):
        raise
    except BleakBluetoothNotAvailableError as error:
        raise LinkLost(_CURES.get(error.reason, _DENIED)) from error
    except BleakDeviceNotFoundError as error:
        raise LinkLost(f"{name} has gone from the air again; bring it nearer, check its battery") from error
    except BleakDBusError as error:
        raise LinkLost(_explain_bus(name, error)) from error
    except FileNotFoundError as error:
        raise LinkLost(_NO_BUS) from error
    except PermissionError as error:
        raise LinkLost(_DENIED) from error
    except (BleakError, OSError, EOFError) as error:
        raise LinkLost(
            f"{name}: Bluetooth fails ({str(error) or type(error).__name__}); switch the strut off and on"
        ) from error


def _explain_bus(name: str, error: BleakDBusError) -> str:
    kind = error.dbus_error.rpartition(".")[2]
    match kind:
        case "ServiceUnknown" | "NameHasNoOwner" | "Spawn.ServiceNotFound" | "NoReply":
            return _NO_SERVICE
        case "AccessDenied" | "NotAuthorized" | "AuthFailed" | "NotPermitted":
            return _DENIED
        case "NotReady":
            return _CURES[BleakBluetoothNotAvailableReason.POWERED_OFF]
        case "UnknownObject" | "DoesNotExist" if "strut" not in name:
            return f"this computer has no Bluetooth adapter {name}; correct adapter in the robot's file{_adapters()}"
    return f"{name}: Bluetooth fails ({error}); switch the strut off and on, and try again"


def _adapters() -> str:
    with suppress(OSError):
        return f" (there are {', '.join(sorted(os.listdir('/sys/class/bluetooth')))})"
    return ""
