"""Names that the fields of CAN frames have, without case, blanks, dashes and underscores."""

from __future__ import annotations

# Role of the native walk -> kinds of values, and names, the likeliest first.
ROLES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "id": (
        ("int", "float", "text"),
        ("canid", "canidentifier", "arbitrationid", "messageid", "msgid", "frameid", "identifier", "id"),
    ),
    "data": (
        ("bytes", "ints", "text"),
        (
            *("data", "payload", "candata", "canpayload", "framedata", "framepayload", "bytevalues"),
            *("databytes", "datahex", "database64", "bytes"),
        ),
    ),
    "extended": (
        ("bool", "int"),
        (
            *("extended", "isextended", "extendedid", "isextendedid", "hasextendedid", "useextendedid"),
            *("extendedidentifier", "isextendedidentifier", "extendedframe", "isextendedframe", "extendedflag"),
            *("extid", "isextid", "extframe", "isextframe", "isext", "ext", "eff", "iseff", "effflag"),
            *("ide", "iside", "xtd", "isxtd"),
        ),
    ),
    "rtr": (
        ("bool", "int"),
        (
            *("rtr", "isrtr", "rtrflag", "rtrframe", "isrtrframe", "remote", "isremote", "remoteframe"),
            *("isremoteframe", "remoteflag", "remoterequest", "isremoterequest"),
            *("remotetransmissionrequest", "isremotetransmissionrequest"),
        ),
    ),
    "error": (
        ("bool", "int"),
        ("errorframe", "iserrorframe", "errframe", "iserrframe", "iserror", "error", "iserr", "err"),
    ),
    "fd": (
        ("bool", "int"),
        ("fd", "isfd", "fdframe", "isfdframe", "canfd", "iscanfd", "canfdframe", "iscanfdframe", "fdf", "edl"),
    ),
    "brs": (("bool", "int"), ("brs", "isbrs", "brsflag", "bitrateswitch", "isbitrateswitch")),
    "esi": (("bool", "int"), ("esi", "isesi", "esiflag", "errorstateindicator")),
    "dlc": (
        ("int", "float"),
        (
            *("dlc", "candlc", "datalengthcode", "len", "length", "datalen", "datalength", "datasize"),
            *("payloadlen", "payloadlength", "payloadsize"),
        ),
    ),
    "bus": (
        ("text", "int"),
        (
            *("interface", "iface", "caninterface", "caniface", "canbus", "canchannel", "canport"),
            *("interfacename", "ifacename", "ifname", "bus", "busname", "busid", "busnumber", "channel"),
        ),
    ),
    "tx": (("bool", "int", "text"), ("tx", "istx", "direction")),
    "stamp_ns": (("int", "float", "text"), ("timestampns", "stampns", "timens", "timestampnsec", "timestampnanos")),
    "stamp_us": (("int", "float", "text"), ("timestampus", "stampus", "timeus", "timestampusec", "timestampmicros")),
}
STAMP = ("timestamp", "stamp", "time", "ts")
SECONDS = ("seconds", "sec", "secs", "s")
NANOSECONDS = ("nanos", "nsec", "nanosec", "nanoseconds", "nsecs", "ns")

# Names of identifiers and data that any message may have.
ANYWHERE = frozenset({"id", "identifier", "messageid", "msgid", "frameid", "data", "payload", "bytes"})
# Roles that only frames of CAN have, unless the field has a name that says little.
OWN = frozenset({"extended", "rtr", "error", "fd", "brs", "esi", "dlc", "bus"})
VAGUE = frozenset(
    {
        *("len", "length", "datalen", "datalength", "datasize", "payloadlen", "payloadlength", "payloadsize"),
        *("iserror", "error", "iserr", "err", "ext", "remote", "channel", "frameid"),
    }
)
