"""The radio of an ESP32 as MicroPython shows it."""

FLAG_READ, FLAG_WRITE_NO_RESPONSE, FLAG_WRITE, FLAG_NOTIFY = 0x02, 0x04, 0x08, 0x10
RADIO = {"sent": [], "value": b"", "advertised": []}


class UUID:
    def __init__(self, text):
        assert len(text) == 36


class BLE:
    def active(self, is_on):
        assert is_on

    def config(self, **options):
        RADIO["config"] = options

    def irq(self, on_event):
        RADIO["on_event"] = on_event

    def gatts_register_services(self, services):
        ((_, ((_, flags),)),) = services
        assert flags == FLAG_READ | FLAG_WRITE | FLAG_WRITE_NO_RESPONSE | FLAG_NOTIFY
        return ((7,),)

    def gatts_set_buffer(self, handle, size):
        assert handle == 7 and size >= 128

    def gatts_read(self, handle):
        return RADIO["value"]

    def gatts_notify(self, host, handle, data):
        if RADIO.get("is_busy"):
            raise OSError(12)
        RADIO["sent"].append((host, handle, data))

    def gap_advertise(self, interval_us, data):
        RADIO["advertised"].append(data)
