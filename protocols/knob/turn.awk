# A recording at the rim as an encoder and a torque sensor on the axis give it.
BEGIN { FS = OFS = ","; deg = 180 / (3.14159265358979 * r) }
/^#/ { print; next }
!head { head = 1; print "time", "angle", "rate", "accel", "torque"; next }
{ printf "%s,%.8g,%.8g,%.8g,%.8g\n", $1, deg * $2, deg * $3, 1000 * deg * $4, $5 * r / 1000 }
