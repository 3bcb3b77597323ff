"""A connection to an MQTT broker that comes back by itself. Knows nothing about stations.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

from taxel.bus.addresses import MqttAddress
from taxel.errors import BadInput, MissingExtra

KEEP_ALIVE_S = 3
"""A broker that hears nothing for one and a half times as long sends the last will, seconds.
Source: MQTT 3.1.1, section 3.1.2.10; the length is our choice, docs/decisions/0052."""
_AGAIN_S = (1, 5)
"""Shortest and longest wait between two tries to connect, seconds. Source: our choice."""
_LARGEST_PASSWORD = 4096


def mqtt_module() -> ModuleType:
    """Return the package.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        import paho.mqtt.client as client
    except ModuleNotFoundError as error:
        raise MissingExtra("paho-mqtt", "bus", "a fleet's broker") from error
    found: ModuleType = client
    return found


class Broker:
    """One connection; use it in a `with` block.

    Args:
        address: The broker, and who speaks to it.
        name: The client's own.
        will: Topic and payload that the broker sends, retained, once this client is gone.
        subscribe: Topics to listen to; a station listens to none.
        on_connect: Called in the connection's thread at each connection.
        on_message: Called there with (topic, payload, retained).

    Raises:
        BadInput: A certificate or password cannot be read.
        MissingExtra: paho-mqtt is not installed.
    """

    def __init__(
        self,
        address: MqttAddress,
        name: str,
        *,
        will: tuple[str, bytes] | None = None,
        subscribe: tuple[str, ...] = (),
        on_connect: Callable[[Broker], None] = lambda _: None,
        on_message: Callable[[str, bytes, bool], None] = lambda *_: None,
    ) -> None:
        mqtt = mqtt_module()
        self.address = address
        self.why = "not connected yet"
        """Why there is no connection; empty where there is one."""
        self._client = client = mqtt.Client(
            mqtt.CallbackAPIVersion.VERSION2, client_id=name, protocol=mqtt.MQTTv311
        )
        client.reconnect_delay_set(*_AGAIN_S)
        _authenticate(client, address)
        if will is not None:
            client.will_set(*will, qos=1, retain=True)

        def connected(_: Any, __: Any, ___: Any, code: Any, ____: Any) -> None:
            self.why = str(code) if code.is_failure else ""
            if not code.is_failure:
                for topic in subscribe:
                    client.subscribe(topic, qos=1)
                on_connect(self)

        def lost(_: Any, __: Any, ___: Any, code: Any, ____: Any) -> None:
            self.why = f"the connection was lost: {code}"

        def failed(*_: Any) -> None:
            self.why = "nobody answers there"

        def came(_: Any, __: Any, message: Any) -> None:
            on_message(message.topic, bytes(message.payload), bool(message.retain))

        client.on_connect, client.on_disconnect = connected, lost
        client.on_connect_fail, client.on_message = failed, came

    @property
    def connected(self) -> bool:
        """True while there is a connection."""
        return bool(self._client.is_connected())

    def publish(self, topic: str, payload: bytes, *, surely: bool = False) -> bool:
        """Send a message, retained; False where there is no connection. Never waits.

        Args:
            topic: Where to.
            payload: What.
            surely: Until the broker has confirmed it, even over a lost connection.
        """
        if not self.connected:
            return False
        self._client.publish(topic, payload, qos=1 if surely else 0, retain=True)
        return True

    def finish(self, topic: str, payload: bytes, longest_s: float = 1.0) -> None:
        """Send a last message, and wait for a short while until it is out."""
        if self.connected:
            sent = self._client.publish(topic, payload, qos=1, retain=True)
            try:
                sent.wait_for_publish(longest_s)
            except (RuntimeError, ValueError):
                return  # it was lost on the way: the last will says so

    def __enter__(self) -> Broker:
        self._client.connect_async(self.address.host, self.address.port, KEEP_ALIVE_S)
        self._client.loop_start()
        return self

    def __exit__(self, *_: object) -> None:
        self._client.disconnect()
        self._client.loop_stop()


def _authenticate(client: Any, address: MqttAddress) -> None:
    if address.tls:
        files = [None if path is None else str(path)
                 for path in (address.ca, address.cert, address.key)]  # fmt: skip
        try:
            client.tls_set(*files)
        except (OSError, ValueError) as error:
            raise BadInput("certificates and a key in PEM", str(error), "name others") from error
    if address.user:
        password = None
        if address.password_file is not None:
            try:
                with address.password_file.open(encoding="utf-8") as file:
                    password = file.read(_LARGEST_PASSWORD).splitlines()[0]
            except (OSError, UnicodeDecodeError, IndexError) as error:
                raise BadInput("a password in the file's first line", str(address.password_file),
                               "write it there") from error  # fmt: skip
        client.username_pw_set(address.user, password)
