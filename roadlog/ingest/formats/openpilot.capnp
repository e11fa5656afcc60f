@0xd6f7c3a1b5e29c40;
# What roadlog reads of an openpilot log: the first fields of some messages, after log.capnp and
# car.capnp of openpilot (comma.ai, MIT licence). Members of no use stand as pointers, which keeps
# the layout; a later version of a message may have more fields after these.

struct Event {
  logMonoTime @0 :UInt64;
  valid @67 :Bool = true;
  union {
    u1 @1 :AnyPointer; u2 @2 :AnyPointer; u3 @3 :AnyPointer; u4 @4 :AnyPointer;
    u5 @5 :AnyPointer; u6 @6 :AnyPointer; u7 @7 :AnyPointer; u8 @8 :AnyPointer;
    u9 @9 :AnyPointer; u10 @10 :AnyPointer;
    sensorEvents @11 :List(SensorEventData);
    u12 @12 :AnyPointer; u13 @13 :AnyPointer; u14 @14 :AnyPointer; u15 @15 :AnyPointer;
    u16 @16 :AnyPointer; u17 @17 :AnyPointer; u18 @18 :AnyPointer;
    liveCalibration @19 :LiveCalibrationData;
    u20 @20 :AnyPointer;
    gpsLocation @21 :GpsLocationData;
    carState @22 :CarState;
    u23 @23 :AnyPointer; u24 @24 :AnyPointer; u25 @25 :AnyPointer; u26 @26 :AnyPointer;
    u27 @27 :AnyPointer; u28 @28 :AnyPointer; u29 @29 :AnyPointer; u30 @30 :AnyPointer;
    u31 @31 :AnyPointer; u32 @32 :AnyPointer; u33 @33 :AnyPointer; u34 @34 :AnyPointer;
    u35 @35 :AnyPointer; u36 @36 :AnyPointer; u37 @37 :AnyPointer; u38 @38 :AnyPointer;
    u39 @39 :AnyPointer; u40 @40 :AnyPointer; u41 @41 :AnyPointer; u42 @42 :AnyPointer;
    u43 @43 :AnyPointer; u44 @44 :AnyPointer; u45 @45 :AnyPointer; u46 @46 :AnyPointer;
    u47 @47 :AnyPointer;
    gpsLocationExternal @48 :GpsLocationData;
    u49 @49 :AnyPointer; u50 @50 :AnyPointer; u51 @51 :AnyPointer; u52 @52 :AnyPointer;
    u53 @53 :AnyPointer; u54 @54 :AnyPointer; u55 @55 :AnyPointer; u56 @56 :AnyPointer;
    u57 @57 :AnyPointer; u58 @58 :AnyPointer; u59 @59 :AnyPointer; u60 @60 :AnyPointer;
    liveParameters @61 :LiveParametersData;
    u62 @62 :AnyPointer; u63 @63 :AnyPointer; u64 @64 :AnyPointer; u65 @65 :AnyPointer;
    u66 @66 :AnyPointer; u68 @68 :AnyPointer; u69 @69 :AnyPointer; u70 @70 :AnyPointer;
    u71 @71 :AnyPointer; u72 @72 :AnyPointer; u73 @73 :AnyPointer; u74 @74 :AnyPointer;
    u75 @75 :AnyPointer; u76 @76 :AnyPointer; u77 @77 :AnyPointer; u78 @78 :AnyPointer;
    u79 @79 :AnyPointer; u80 @80 :AnyPointer; u81 @81 :AnyPointer; u82 @82 :AnyPointer;
    u83 @83 :AnyPointer; u84 @84 :AnyPointer; u85 @85 :AnyPointer; u86 @86 :AnyPointer;
    u87 @87 :AnyPointer; u88 @88 :AnyPointer; u89 @89 :AnyPointer; u90 @90 :AnyPointer;
    u91 @91 :AnyPointer; u92 @92 :AnyPointer; u93 @93 :AnyPointer; u94 @94 :AnyPointer;
    u95 @95 :AnyPointer; u96 @96 :AnyPointer; u97 @97 :AnyPointer;
    accelerometer @98 :SensorEventData;
    gyroscope @99 :SensorEventData;
    u100 @100 :AnyPointer; u101 @101 :AnyPointer; u102 @102 :AnyPointer; u103 @103 :AnyPointer;
    u104 @104 :AnyPointer; u105 @105 :AnyPointer; u106 @106 :AnyPointer; u107 @107 :AnyPointer;
    u108 @108 :AnyPointer; u109 @109 :AnyPointer; u110 @110 :AnyPointer; u111 @111 :AnyPointer;
    u112 @112 :AnyPointer; u113 @113 :AnyPointer; u114 @114 :AnyPointer; u115 @115 :AnyPointer;
    u116 @116 :AnyPointer; u117 @117 :AnyPointer; u118 @118 :AnyPointer; u119 @119 :AnyPointer;
    u120 @120 :AnyPointer; u121 @121 :AnyPointer; u122 @122 :AnyPointer; u123 @123 :AnyPointer;
    u124 @124 :AnyPointer; u125 @125 :AnyPointer; u126 @126 :AnyPointer; u127 @127 :AnyPointer;
    u128 @128 :AnyPointer;
    livePose @129 :LivePose;
  }
}

struct SensorEventData {
  version @0 :Int32;
  sensor @1 :Int32;
  type @2 :Int32;
  timestamp @3 :Int64;
  union {
    acceleration @4 :SensorVec;
    magnetic @5 :SensorVec;
    orientation @6 :SensorVec;
    gyro @7 :SensorVec;
    pressure @9 :SensorVec;
    magneticUncalibrated @11 :SensorVec;
    gyroUncalibrated @12 :SensorVec;
    proximity @13 :Float32;
    light @14 :Float32;
    temperature @15 :Float32;
  }
  source @8 :UInt16;
  uncalibrated @10 :Bool;

  struct SensorVec {
    v @0 :List(Float32);
    status @1 :Int8;
  }
}

struct GpsLocationData {
  flags @0 :UInt16;
  latitude @1 :Float64;
  longitude @2 :Float64;
  altitude @3 :Float64;
  speed @4 :Float32;
  bearingDeg @5 :Float32;
  horizontalAccuracy @6 :Float32;
  unixTimestampMillis @7 :Int64;
  source @8 :UInt16;
  vNED @9 :List(Float32);
  verticalAccuracy @10 :Float32;
  bearingAccuracyDeg @11 :Float32;
  speedAccuracy @12 :Float32;
}

struct CarState {
  errors @0 :AnyPointer;
  vEgo @1 :Float32;
  wheelSpeeds @2 :WheelSpeeds;
  gas @3 :Float32;
  gasPressed @4 :Bool;
  brake @5 :Float32;
  brakePressed @6 :Bool;
  steeringAngleDeg @7 :Float32;
  steeringTorque @8 :Float32;
  steeringPressed @9 :Bool;
  cruiseState @10 :AnyPointer;
  buttonEvents @11 :AnyPointer;
  canMonoTimes @12 :AnyPointer;
  events @13 :AnyPointer;
  gearShifter @14 :UInt16;
  steeringRateDeg @15 :Float32;
  aEgo @16 :Float32;
  vEgoRaw @17 :Float32;

  struct WheelSpeeds {
    fl @0 :Float32;
    fr @1 :Float32;
    rl @2 :Float32;
    rr @3 :Float32;
  }
}

struct LiveCalibrationData {
  warpMatrix @0 :AnyPointer;
  calStatus @1 :Int8;
  calCycle @2 :Int32;
  calPerc @3 :Int8;
  extrinsicMatrix @4 :AnyPointer;
  warpMatrix2 @5 :AnyPointer;
  warpMatrixBig @6 :AnyPointer;
  rpyCalib @7 :List(Float32);
}

struct LiveParametersData {
  valid @0 :Bool;
  gyroBias @1 :Float32;
  angleOffsetDeg @2 :Float32;
  angleOffsetAverageDeg @3 :Float32;
  stiffnessFactor @4 :Float32;
  steerRatio @5 :Float32;
  sensorValid @6 :Bool;
  yawRate @7 :Float32;
  posenetSpeed @8 :Float32;
  posenetValid @9 :Bool;
  angleOffsetFastStd @10 :Float32;
  angleOffsetAverageStd @11 :Float32;
  stiffnessFactorStd @12 :Float32;
  steerRatioStd @13 :Float32;
  roll @14 :Float32;
}

struct LivePose {
  orientationNED @0 :XYZMeasurement;
  velocityDevice @1 :XYZMeasurement;
  accelerationDevice @2 :XYZMeasurement;
  angularVelocityDevice @3 :XYZMeasurement;
  inputsOK @4 :Bool;
  posenetOK @5 :Bool;
  sensorsOK @6 :Bool;

  struct XYZMeasurement {
    x @0 :Float32;
    y @1 :Float32;
    z @2 :Float32;
    xStd @3 :Float32;
    yStd @4 :Float32;
    zStd @5 :Float32;
    valid @6 :Bool;
  }
}
