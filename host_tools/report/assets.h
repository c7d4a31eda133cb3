/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  assets.h
 * @brief The files that the page is made of, put into the program by embed.cmake. Each ends with '\0'.
 */
#ifndef EVR_ASSETS_H
#define EVR_ASSETS_H

extern const char evr_asset_report_html[];
extern const char evr_asset_report_css[];
/* The script, in this order. */
extern const char evr_asset_page_js[];
extern const char evr_asset_before_after_js[];
extern const char evr_asset_animation_js[];
extern const char evr_asset_flight_js[];
extern const char evr_asset_plots_js[];
extern const char evr_asset_tables_js[];
extern const char evr_asset_evaluation_js[];
extern const char evr_asset_main_js[];

#endif
