/* The player of a page with a motion; the script asks whether it exists. */
declare const player: any;
