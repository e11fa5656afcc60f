"""The words that loggers use for signals, in one table: role -> forms of its name.

A form is a regular expression for a whole name in lower case, without accents, blanks, units and
the words around it that say where it was measured (`AccX_IMU1` is `accx`, `vFzg_HL` is `vfzghl`).
English, German and Romance languages, other scripts by way of English (`abroad`); VBOX, AiM,
MoTeC, RaceChrono, OxTS, dSPACE, ETAS, J1939 and the buses of car makers.
"""

from __future__ import annotations

import re

# parts of forms
_ACCEL = (
    r"(?:a|acc|accel|acl|acln|acceleration|accelerometer|beschl|beschleunigung|aceleracion|acel"
    r"|accelerazione|gforce|gf|f|specificforce|acelerometro)"
)
_RATE = r"(?:rate|vel|velocity|speed|spd|w|gesch\w*|winkelgesch\w*|drehrate)"
_GYRO = (
    r"(?:w|g|gyr|gyro|gyroscope|omega|om|angrate|angularrate|angvel|angularvelocity|rotationrate"
    r"|rotrate|rotation|gyrorotation|rateofrotation|drehrate|rate|winkelgesch\w*"
    r"|(?:vitesse|velocidad|velocita|vel)ang\w*?)"
)
_LONG = r"(?:lon|lng|lgt|long|longi|longitudinale?|longit|laengs|langs|inline|fwd|forward|fore)"
_LAT = r"(?:lat|lateral\w*?|quer|seiten|trans|transversal\w*?)"
_VERT = r"(?:vert|vertical\w*?|vertikal\w*?|hoch|upward)"
_FORCE = rf"(?:{_ACCEL}|g)"
_SPEED = (
    r"(?:v|vel|velocity|spd|speed|geschw|geschwindigkeit|vitesse|vit|velocidade?|velocita"
    r"|snelheid|hastighet)"
)
_WHEEL = r"(?:wheels?|whls?|w|rad|raeder|roue|rueda|ruota|roda|ws)"
_TURN = r"(?:speed|spd|vel|velocity|v|geschw\w*?|vitesse|velocidad|w)?(?:based)?"
_SLOPE = (
    r"(?:slope|grade|gradient|incline|steigung|laengsneigung|langsneigung|neigung|pente|pendiente"
    r"|pendenza|inclinacao)"
)
_BANK = (
    r"(?:bank|crossslope|crossfall|camber|querneigung|devers|peralte|superelevation"
    r"|pendenzatrasversale|sopraelevazione)"
)

CORNERS = {
    "fl": r"(?:fl|lf|vl|flh|frontleft|leftfront|frleft|vornelinks|vorneli|delanteraizquierda"
    r"|avantgauche|avg|antsx|anterioresinistra|delizq|diant?esq|dianteiraesquerda)",
    "fr": r"(?:fr|rf|vr|frh|frontright|rightfront|frright|vornerechts|vornere|delanteraderecha"
    r"|avantdroite?|avd|antdx|anterioredestra|delder|diant?dir|dianteiradireita)",
    "rl": r"(?:rl|lr|hl|rlh|rearleft|leftrear|releft|hintenlinks|hintenli|traseraizquierda"
    r"|arrieregauche|arg|postsx|posterioresinistra|trasizq|trasesq|traseiraesquerda)",
    "rr": r"(?:rr|hr|rrh|rearright|rightrear|reright|hintenrechts|hintenre|traseraderecha"
    r"|arrieredroite?|ard|postdx|posterioredestra|trasder|trasdir|traseiradireita)",
}

_ROLL = r"(?:roll|wank\w*|roulis|balanceo|alabeo|rollio|rolagem)"
_PITCH = r"(?:pitch|nick\w*|tangage|cabeceo|beccheggio|arfagem)"
_YAW = r"(?:yaw|gier\w*|lacet|guinada|imbardata)"


def _either(*words: str) -> tuple[str, ...]:
    """Two words in either order."""
    first, second = words
    return f"{first}{second}", f"{second}{first}"


def _turning(axis: str) -> tuple[str, ...]:
    """Of a rate about an axis, in the word order of English and German or of Romance languages."""
    rate = r"(?:vel|velocidade?|velocita|vitesse|vit|taux|tasa|taxa|tasso)(?:ang\w*?)?"
    return rf"(?:gyro)?{axis}{_RATE}", rf"{rate}(?:de|du|di|d|en)?{axis}"


NAMES: dict[str, tuple[str, ...]] = {
    **{f"imu.accel_{a}": (f"{_ACCEL}{a}(?:axis|achse|veh|v)?", f"{a}{_ACCEL}") for a in "xyz"},
    **{f"imu.gyro_{a}": (f"{_GYRO}{a}(?:axis|achse|v)?", f"{a}{_GYRO}") for a in "xyz"},
    **{
        f"wheel_speeds.{wheel}": (
            f"{_WHEEL}{_TURN}{corner}",
            f"{_WHEEL}{corner}{_TURN}",
            f"(?!lrw){corner}{_WHEEL}{_TURN}",  # LRW: the angle of the steering wheel
            f"(?:v|vrad|n|nrad|abs|spd|speed){corner}",
            f"{corner}(?:spd|speed|radgeschw\\w*)",
            f"(?:vitesse|vit|velocidade?|velocita|vel)(?:de)?(?:lla|la)?{_WHEEL}{corner}",
        )
        for wheel, corner in CORNERS.items()
    },
    "speed.v": (
        rf"{_SPEED}(?:x|2d|fwd|forward|horizontal|overground|uebergrund|ausol|kph|signal)?",
        rf"(?:ground|gnd|road|fzg|fahrzeug|fahrt|drive|corr|corrected|horizontal|xmission|tacho|fahr"
        rf"|indicated|longitudinal|forward|2d|wheelbasedvehicle|wheelbased|disp|avg){_SPEED}",
        r"vfzg(?:hl|hr|vl|vr|h|v)?",
        r"vveh|vehv|vlong|vlon|vehvv|vactl\w*|velocidad(?:del)?vehiculo|vitesse(?:du)?vehicule|velocita(?:del)?veicolo|velocidade(?:do)?veiculo|speedovergrnd|sog|gspeed",
    ),
    "gnss.speed": (r"knots|kts",),  # a unit for a name: of a receiver
    "gnss.climb": (
        r"(?:vert|vertical|v|climb|up|steig|vertikal)(?:vel|velocity|speed|spd|geschw\w*)",
        r"climb(?:rate)?|velup|vup|vertvelocity|steigrate|(?:vitesse|velocidad|velocita)vertical\w*",
    ),
    "gnss.latitude": (
        r"lat|latitude|breite|breitengrad|geo(?:gr\w*)?breite(?:ngrad)?|latitud|latitudine|latdeg"
        r"|breedtegraad",
    ),
    "gnss.longitude": (
        r"lon|long|lng|longitude|laenge|laengengrad|langengrad|lange|geo(?:gr\w*)?laenge(?:ngrad)?"
        r"|longitud|longitudine|lengtegraad",
    ),
    "gnss.altitude": (
        r"alt|alti|altitude|altitudine|hoogte|height|elevation|elev|h(?:oe|o)he(?:ueber(?:nh?n|meer\w*|null\w*))?|altura|altitud|quota|hmsl|altmsl|heightmsl"
        r"|msl|mslaltitude|altitudemsl|ellipsoidheight|h(?:gps|gnss)|(?:gps|gnss)h",
    ),
    "gnss.course": (
        r"course|bearing|cog|track|trackangle|kurs|koers|cap|rumbo|rumo|rotta|heading|hdg|courseoverground|headmot",
    ),
    "steering.road_wheel_angle": (
        r"(?:steer|steering|steered|stwhl|strwhl|strgwhl|strg|lenkrad|lenk|lrw|swa|sas|volante?)"
        r"(?:wheel|whl)?(?:angle|ang|winkel|wi|position|pos|w)?",
        r"swa|swangle|lws|lrw|lwwinkel|deltah|anglevolant|angulovolante|lenkwinkel|roadwheelangle|rwa",
    ),
    "powertrain.engine_torque": (
        r"(?:eng|engine|motor|mot|ice|moteur)(?:trq|tq|torque|moment|drehmoment|mom|couple)",
        r"couplemoteur|parmotor",
    ),
}

# by the car's words for its axes; the sensor then is in vehicle axes but for signs
WORDED: dict[str, tuple[str, ...]] = {
    "imu.accel_x": _either(_LONG, _FORCE),
    "imu.accel_y": _either(_LAT, _FORCE),
    "imu.accel_z": _either(_VERT, _FORCE),
    "imu.gyro_x": (
        *_turning(_ROLL),
        r"wroll|rollw|wwank|phidot|dphi|phip",
    ),
    "imu.gyro_y": (
        *_turning(_PITCH),
        r"wpitch|pitchw|wnick|thetadot|dtheta|thetap",
    ),
    "imu.gyro_z": (
        *_turning(_YAW),
        r"vyaw|vyawveh|wyaw|yaww\w*|wgier|yawr|psip|psidot|dpsi|gier",
    ),
}

# the axis alone, of a column whose unit is that of a rate
TURNS: dict[str, tuple[str, ...]] = {
    "imu.gyro_x": (_ROLL,),
    "imu.gyro_y": (_PITCH,),
    "imu.gyro_z": (_YAW,),
}

# what a reference states, where its name says that it is one
REFERENCES: dict[str, tuple[str, ...]] = {
    "truth.grade": (rf"(?:road|fahrbahn|strassen)?{_SLOPE}(?:angle|winkel)?",),
    "truth.bank": (rf"(?:road|fahrbahn|strassen)?{_BANK}(?:angle|winkel)?",),
    "truth.inclination": (
        r"(?:pitch|nick|inclination|tangage|cabeceo|beccheggio)(?:angle|winkel)?",
    ),
    "truth.roll_total": (r"(?:roll|wank|roulis|alabeo|rollio)(?:angle|winkel)?",),
}

# words that say where, of which device or how filtered
AROUND = re.compile(
    r"imu|ins|mems|ahrs|esp|esc|abs|dsc|vdc|ecu|can|bus|sensor|sensors|sns|"
    r"sig|signal|val|value|raw|filt|filtered|flt|filter|smooth|smoothed|meas|"
    r"measured|mess|act|actual|ist|est|estimate|cal|calibrated|corr|cog|body|"
    r"bdy|veh|vehicle|car|chassis|device|phone|vbox|vb|racelogic|oxts|aim|"
    r"motec|rcm|di|lwi|sas|acm|uncal|a1|app|log|logger|data|ch|chan|channel|"
    r"abs|mean|avg|grnd|cm|mm|baro|barometer|barometric|pressure|relative|"
    r"sensorcluster|cluster|rt|rt3000|xsens|novatel|ellipse|vn|obd|ebs|asr|tcs|srs|position|pos|"
    r"bmi|bno|mpu|icm|lsm\w*|adxl|mti|sbg"
)
SATELLITE = re.compile(r"gps|gnss|rtk|nav|dgps|fix|ublox|sat")
TRUE = re.compile(
    r"true|truth|ref|reference|gt|rtk|survey|soll|referenz|verite|verdad|rif|riferimento|referencia"
)
# words of names that are something else
OTHER = (
    r"valid|accuracy|genauigkeit|precision|status|quality|limit|target|setpoint|engine|turbine|wiper"
    r"|cruise|request|predicted|sigma|(?<![a-z])(?:std|cov|count|fan|wind|rpm|north|east|down|err"
    r"|error|diff|ratio|lap|max|min|tire|tyre|motor|(?<!head_)mot|eng)(?![a-z])"
)
