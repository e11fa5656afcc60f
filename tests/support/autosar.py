"""An AUTOSAR 4 system description of two frames: `Motion`, and a container that may hold it too."""

from __future__ import annotations

HEADER = 0x0A0B0C  # of Motion in the container
# name, first bit, bits, factor, unit; all signed but the speed
SIGNALS = (
    ("VehicleSpeed", 0, 16, 0.01, "km/h", "UINT16"),
    ("AccelX", 16, 16, 0.001, "m/s^2", "SINT16"),
    ("AccelZ", 32, 16, 0.001, "m/s^2", "SINT16"),
)


def _element(tag: str, name: str, inside: str = "", **texts: object) -> str:
    more = "".join(f"<{k}>{v}</{k}>" for k, v in texts.items())
    return f"<{tag}><SHORT-NAME>{name}</SHORT-NAME>{more}{inside}</{tag}>"


def _ref(tag: str, kind: str, path: str) -> str:
    return f'<{tag} DEST="{kind}">{path}</{tag}>'


def _package(name: str, *elements: str) -> str:
    return _element("AR-PACKAGE", name, f"<ELEMENTS>{''.join(elements)}</ELEMENTS>")


def _frame(name: str, kind: str, size: int) -> str:
    pdu = _element("PDU-TO-FRAME-MAPPING", "mapping", _ref("PDU-REF", kind, f"/Pdu/{name}"))
    inside = f"<PDU-TO-FRAME-MAPPINGS>{pdu}</PDU-TO-FRAME-MAPPINGS>"
    return _element("CAN-FRAME", name, inside, **{"FRAME-LENGTH": size})


def _triggering(name: str, identifier: int) -> str:
    frame = _ref("FRAME-REF", "CAN-FRAME", f"/Frame/{name}")
    rest = "<CAN-ADDRESSING-MODE>STANDARD</CAN-ADDRESSING-MODE>"
    rest += f"<IDENTIFIER>{identifier}</IDENTIFIER>"
    return _element("CAN-FRAME-TRIGGERING", f"{name}_sent", frame + rest)


def _signal(name: str, bits: int, base: str) -> str:
    properties = _ref("BASE-TYPE-REF", "SW-BASE-TYPE", f"/Base/{base}")
    network = f"<SW-DATA-DEF-PROPS-VARIANTS><SW-DATA-DEF-PROPS-CONDITIONAL>{properties}"
    network += "</SW-DATA-DEF-PROPS-CONDITIONAL></SW-DATA-DEF-PROPS-VARIANTS>"
    inside = f"<LENGTH>{bits}</LENGTH><NETWORK-REPRESENTATION-PROPS>{network}"
    inside += "</NETWORK-REPRESENTATION-PROPS>"
    inside += _ref("SYSTEM-SIGNAL-REF", "SYSTEM-SIGNAL", f"/System/{name}")
    return _element("I-SIGNAL", name, inside)


def _meaning(name: str) -> str:
    method = _ref("COMPU-METHOD-REF", "COMPU-METHOD", f"/Method/{name}")
    inside = "<PHYSICAL-PROPS><SW-DATA-DEF-PROPS-VARIANTS><SW-DATA-DEF-PROPS-CONDITIONAL>"
    inside += f"{method}</SW-DATA-DEF-PROPS-CONDITIONAL></SW-DATA-DEF-PROPS-VARIANTS>"
    return _element("SYSTEM-SIGNAL", name, f"{inside}</PHYSICAL-PROPS>")


def _method(name: str, factor: float) -> str:
    unit = _ref("UNIT-REF", "UNIT", f"/Unit/{name}")
    scale = f"<COMPU-NUMERATOR><V>0</V><V>{factor}</V></COMPU-NUMERATOR>"
    scale += "<COMPU-DENOMINATOR><V>1</V></COMPU-DENOMINATOR>"
    inside = f"<CATEGORY>LINEAR</CATEGORY>{unit}<COMPU-INTERNAL-TO-PHYS><COMPU-SCALES><COMPU-SCALE>"
    inside += f"<COMPU-RATIONAL-COEFFS>{scale}</COMPU-RATIONAL-COEFFS></COMPU-SCALE>"
    return _element("COMPU-METHOD", name, f"{inside}</COMPU-SCALES></COMPU-INTERNAL-TO-PHYS>")


def description() -> str:
    """The text: Motion is 0x64, the container 0x65."""
    mapped = "".join(
        _element(
            "I-SIGNAL-TO-I-PDU-MAPPING",
            name,
            _ref("I-SIGNAL-REF", "I-SIGNAL", f"/Signal/{name}")
            + "<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER>"
            + f"<START-POSITION>{start}</START-POSITION>",
        )
        for name, start, *_ in SIGNALS
    )
    header = f"<HEADER-ID-SHORT-HEADER>{HEADER:#08x}</HEADER-ID-SHORT-HEADER>"
    motion = f"<LENGTH>8</LENGTH><CONTAINED-I-PDU-PROPS>{header}</CONTAINED-I-PDU-PROPS>"
    motion += f"<I-SIGNAL-TO-PDU-MAPPINGS>{mapped}</I-SIGNAL-TO-PDU-MAPPINGS>"
    held = _ref("CONTAINED-PDU-TRIGGERING-REF", "PDU-TRIGGERING", "/Bus/Car/Wire/Motion_held")
    box = f"<LENGTH>64</LENGTH><CONTAINED-PDU-TRIGGERING-REFS>{held}"
    box += "</CONTAINED-PDU-TRIGGERING-REFS><HEADER-TYPE>SHORT-HEADER</HEADER-TYPE>"
    pdu = _element(
        "PDU-TRIGGERING", "Motion_held", _ref("I-PDU-REF", "I-SIGNAL-I-PDU", "/Pdu/Motion")
    )
    sent = _triggering("Motion", 0x64) + _triggering("Box", 0x65)
    wire = f"<FRAME-TRIGGERINGS>{sent}</FRAME-TRIGGERINGS>"
    wire += f"<PDU-TRIGGERINGS>{pdu}</PDU-TRIGGERINGS>"
    channel = _element("CAN-PHYSICAL-CHANNEL", "Wire", wire)
    cluster = "<CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL><BAUDRATE>500000</BAUDRATE>"
    cluster += f"<PHYSICAL-CHANNELS>{channel}</PHYSICAL-CHANNELS>"
    cluster += "</CAN-CLUSTER-CONDITIONAL></CAN-CLUSTER-VARIANTS>"
    encodings = {"UINT16": "NONE", "SINT16": "2C"}
    packages = (
        _package("Bus", _element("CAN-CLUSTER", "Car", cluster)),
        _package(
            "Frame", _frame("Motion", "I-SIGNAL-I-PDU", 8), _frame("Box", "CONTAINER-I-PDU", 64)
        ),
        _package(
            "Pdu",
            _element("I-SIGNAL-I-PDU", "Motion", motion),
            _element("CONTAINER-I-PDU", "Box", box),
        ),
        _package("Signal", *(_signal(name, bits, base) for name, _, bits, _, _, base in SIGNALS)),
        _package("System", *(_meaning(name) for name, *_ in SIGNALS)),
        _package("Method", *(_method(name, factor) for name, _, _, factor, _, _ in SIGNALS)),
        _package(
            "Unit",
            *(_element("UNIT", name, **{"DISPLAY-NAME": unit}) for name, *_, unit, _ in SIGNALS),
        ),
        _package(
            "Base",
            *(
                _element("SW-BASE-TYPE", name, **{"BASE-TYPE-ENCODING": encoding})
                for name, encoding in encodings.items()
            ),
        ),
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<AUTOSAR xmlns="http://autosar.org/schema/r4.0" '
        'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="http://autosar.org/schema/r4.0 AUTOSAR_00046.xsd">'
        f"<AR-PACKAGES>{''.join(packages)}</AR-PACKAGES></AUTOSAR>\n"
    )
