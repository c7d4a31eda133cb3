# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# The library as a plain list, for builds that do not use our CMake targets: include() this file, compile EVS_SOURCES
# as C99 and put EVS_INCLUDE_DIR on the include path. Nothing else is needed.
set(EVS_INCLUDE_DIR ${CMAKE_CURRENT_LIST_DIR}/include)
set(EVS_SOURCES
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_attitude.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_attitude_valenti.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_camera.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_clock.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_corners.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_decay_table.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_egomotion.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_egomotion_pack.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_egomotion_paper.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_egomotion_refine.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_egomotion_rotation.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_egomotion_search.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_fixed.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_flow.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_flow_grid.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_flow_mve.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_flow_pairs.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_flow_plain.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_flow_sse2.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_gauss_table.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_gyro_bias.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_homography.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_homography_avx2.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_homography_dsp.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_homography_mve.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_image.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_iwe.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_iwe_render.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_keyframes.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_orientation_track.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_pipeline.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_pipeline_imaging.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_recip_table.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_scaled.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_stabilize.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_surface.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_tiles.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_types.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_undistort.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_undistort_mve.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_undistort_sse2.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_vec.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_velocity.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_velocity_mismatch.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_warp.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_warp_contrast.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_wide.c
    ${CMAKE_CURRENT_LIST_DIR}/src/evs_window.c
)
