"""Words of loggers in other scripts than ours, and what they are in English.

Japanese, Chinese, Korean and Russian, the longest first where one is part of another.
"""

from __future__ import annotations

_LONG, _LAT, _VERT = " accel long ", " accel lat ", " accel vert "
_ROLL, _PITCH, _YAW = " roll rate ", " pitch rate ", " yaw rate "

_WORDS = {
    # Japanese
    "前後加速度": _LONG,
    "前後g": _LONG,
    "左右加速度": _LAT,
    "横加速度": _LAT,
    "左右g": _LAT,
    "横g": _LAT,
    "上下加速度": _VERT,
    "上下g": _VERT,
    "ロールレート": _ROLL,
    "ロール角速度": _ROLL,
    "ピッチレート": _PITCH,
    "ピッチ角速度": _PITCH,
    "ヨーレート": _YAW,
    "ヨー角速度": _YAW,
    "加速度": " accel ",
    "角速度": " gyro ",
    "時間": " time ",
    "時刻": " time ",
    "車速": " speed ",
    "速度": " speed ",
    "緯度": " latitude ",
    "経度": " longitude ",
    "標高": " altitude ",
    "高度": " altitude ",
    "方位": " course ",
    "路面勾配": " ref grade ",
    # Chinese
    "纵向加速度": _LONG,
    "侧向加速度": _LAT,
    "横向加速度": _LAT,
    "垂向加速度": _VERT,
    "垂直加速度": _VERT,
    "侧倾角速度": _ROLL,
    "俯仰角速度": _PITCH,
    "横摆角速度": _YAW,
    "时间": " time ",
    "车速": " speed ",
    "纬度": " latitude ",
    "经度": " longitude ",
    "海拔": " altitude ",
    "航向角": " course ",
    "航向": " course ",
    # Korean
    "종가속도": _LONG,
    "종방향가속도": _LONG,
    "횡가속도": _LAT,
    "횡방향가속도": _LAT,
    "수직가속도": _VERT,
    "롤각속도": _ROLL,
    "롤레이트": _ROLL,
    "피치각속도": _PITCH,
    "피치레이트": _PITCH,
    "요각속도": _YAW,
    "요레이트": _YAW,
    "시간": " time ",
    "차속": " speed ",
    "속도": " speed ",
    "위도": " latitude ",
    "경도": " longitude ",
    "고도": " altitude ",
    # Russian
    "продольное ускорение": _LONG,
    "поперечное ускорение": _LAT,
    "боковое ускорение": _LAT,
    "вертикальное ускорение": _VERT,
    "скорость крена": _ROLL,
    "скорость тангажа": _PITCH,
    "скорость рысканья": _YAW,
    "скорость рыскания": _YAW,
    "ускорение": " accel ",
    "время": " time ",
    "скорость": " speed ",
    "широта": " latitude ",
    "долгота": " longitude ",
    "высота": " altitude ",
    "курс": " course ",
}
_WORDS = dict(sorted(_WORDS.items(), key=lambda pair: -len(pair[0])))


def in_english(name: str) -> str:
    """A name with those of its words that are known here in English; others stay as they are."""
    if name.isascii():
        return name
    lower = name.lower()
    if not any(word in lower for word in _WORDS):
        return name
    for word, english in _WORDS.items():
        lower = lower.replace(word, english)
    return lower
