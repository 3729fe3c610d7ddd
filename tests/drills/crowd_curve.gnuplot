# gnuplot -c crowd_curve.gnuplot CURVE.csv CURVE.svg: what crowd_drill.py saw.
set terminal svg size 900,420 font "sans,12" background "white"
set output ARG2
set datafile separator ","
set key outside top center horizontal
set xlabel "s"
set ylabel "resident memory [MiB]"
set y2label "steps accepted"
set yrange [0:*]
set y2range [0:*]
set ytics nomirror
set y2tics
plot ARG1 using 1:3 every ::1 with lines lw 2 title "replay server", \
     ARG1 using 1:4 every ::1 with lines lw 2 title "learner", \
     ARG1 using 1:5 every ::1 with lines lw 2 title "largest actor", \
     ARG1 using 1:6 every ::1 axes x1y2 with points pt 7 ps 0.3 title "steps accepted (right)"
