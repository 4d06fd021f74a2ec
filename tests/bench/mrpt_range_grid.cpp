// How fast MRPT's occupancy grid takes sonar readings, and which cells one pass of them touches.
// usage: mrpt_range_grid CELL_M APERTURE_RAD CPU_SECONDS < readings; a reading is a line: x_m y_m axis_rad range_m
// prints: readings per second of computing, cells that a first pass has changed

#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservationRange.h>
#include <mrpt/poses/CPose3D.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

struct Reading {
    mrpt::poses::CPose3D pose;
    mrpt::obs::CObservationRange observation;
};

// One observation for each sonar: MRPT takes all ranges of one observation to be from one pose. It fills the cone from the heading less its
// aperture up to the heading (COccupancyGridMap2D_insert.cpp), so the heading given is half the aperture past the axis.
static std::vector<Reading> read_all(double aperture_rad) {
    std::vector<Reading> readings;
    double x, y, axis, range;
    while (std::scanf("%lf %lf %lf %lf", &x, &y, &axis, &range) == 4) {
        Reading one;
        one.pose = mrpt::poses::CPose3D(x, y, 0, axis + aperture_rad / 2, 0, 0);
        one.observation.sensorConeApperture = static_cast<float>(aperture_rad);
        one.observation.sensedData.emplace_back();
        one.observation.sensedData.back().sensedDistance = static_cast<float>(range);
        readings.push_back(one);
    }
    return readings;
}

static void insert_all(mrpt::maps::COccupancyGridMap2D& grid, const std::vector<Reading>& readings) {
    for (const Reading& one : readings) grid.insertObservation(one.observation, one.pose);
}

static long cells_changed(const mrpt::maps::COccupancyGridMap2D& grid) {
    const auto untouched = mrpt::maps::COccupancyGridMap2D::p2l(0.5f);
    long changed = 0;
    for (const auto cell : grid.getRawMap()) changed += cell != untouched;
    return changed;
}

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    const double cell_m = std::atof(argv[1]), seconds = std::atof(argv[3]);
    const auto readings = read_all(std::atof(argv[2]));
    mrpt::maps::COccupancyGridMap2D grid(-6, 6, -6, 6, static_cast<float>(cell_m));
    insert_all(grid, readings);
    const long changed = cells_changed(grid);

    const std::clock_t began = std::clock();
    long inserted = 0;
    double passed_s = 0;
    while (passed_s < seconds) {
        insert_all(grid, readings);
        inserted += static_cast<long>(readings.size());
        passed_s = static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;
    }
    std::printf("%.1f %ld\n", inserted / passed_s, changed);
}
